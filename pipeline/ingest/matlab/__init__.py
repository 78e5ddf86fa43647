"""MATLAB files up to version 7: `READER` reads them."""

from pipeline.ingest.matlab.reader import READER

__all__ = ["READER"]
