"""Force and field against coil current at a fixed gap, held level by level (mre.md T2, T4)."""
