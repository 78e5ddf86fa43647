"""`tire.road`: load, longitudinal force and speed of every revolution of a drive, and its events (tire.md, 5.11-5.13)."""
