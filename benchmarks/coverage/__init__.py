"""Do 95 % intervals hold the truth 95 times in 100? Simulated campaigns with all the dirt of real logs, known truth.

    python -m benchmarks.coverage [EXPERIMENT ...] [--case NAME] [--campaigns 200] [--first 0] [--jobs 2] [--write]

One module an experiment stands in `studies`. With --write the numbers go into docs/uncertainty/, and from there into the
tables of docs/uncertainty.md.
"""
