"""MCAP logs: `READER` reads them; `writer` writes recordings as such."""

from pipeline.ingest.mcap_log.reader import READER

__all__ = ["READER"]
