"""Speed against what a user would otherwise run, as ratios measured in one run.

Each module exports ``measure() -> list[dict]`` with the keys what, against, ours, theirs (seconds),
goal, and unit where it is not s; ``python -m benchmarks [NAME...]`` runs them and prints one table.
"""
