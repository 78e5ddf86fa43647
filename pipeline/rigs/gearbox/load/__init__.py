"""Inertia and drag of the load by modulating functions, friction over speed, misfit checks (5.4, 5.6, 5.8)."""
