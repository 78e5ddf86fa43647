"""Payloads to columns, one module an encoding; each offers ``decode(payloads, wanted)``."""
