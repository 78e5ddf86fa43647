"""MATLAB files: `READER` reads them."""

from pipeline.ingest.matlab.reader import READER

__all__ = ["READER"]
