"""Mesh lines and the input speed they tell, levels by stage (5.5, 5.7)."""
