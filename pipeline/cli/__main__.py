"""Lets `python -m pipeline.cli` do what the command `rigfit` does."""

from pipeline.cli.main import main

main()
