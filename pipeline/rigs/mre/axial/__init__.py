"""Experiment mre.axial: slow compression and release of a pad (mre.md T1)."""
