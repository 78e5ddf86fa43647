"""Alarms re-derived from a log, and the two units held against each other (rap.md, 3.9 and 3.10)."""
