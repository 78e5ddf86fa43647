"""Experiment mre.shear_rich: one long record per current, by a batch fit and by an online filter (mre.md T8)."""
