"""Therapy runs of the device: temperature, ultrafiltrate, membrane, battery, alarms and redundancy (rap.md, 10)."""
