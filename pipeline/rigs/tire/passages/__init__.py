"""From the transmitter's log to revolutions, averaged waveforms and their features (tire.md, 5.1 to 5.5)."""
