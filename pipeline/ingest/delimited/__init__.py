"""Delimited text: tables of numbers as labs, loggers and test machines write them."""

from pipeline.ingest.delimited.reader import READER

__all__ = ["READER"]
