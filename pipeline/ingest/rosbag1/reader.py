"""The reader of ROS 1 bags, version 2.0: each topic is a table, its time is when the recorder got the message.

The file is mapped here, its messages are read as those of MCAP are. Bags hold the definitions of their messages: no library
is needed.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.ingest.mcap_log.reader import log_of
from pipeline.ingest.reader import RawLog, Reader
from pipeline.ingest.rosbag1.layout import MAGIC, survey_bag
from pipeline.ingest.rosbag1.messages import BagMessages


class Rosbag1Reader(Reader):
    """Reads bags of version 2.0, indexed or not, compressed with bz2 or lz4 or not at all."""

    name = "rosbag1"
    version = 1
    suffixes = (".bag",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the first line; a file named .bag is taken too, to say what is wrong with it."""
        return head.startswith(MAGIC) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Map the file, look at messages of every topic and list their fields.

        Raises
        ------
        InputError
            If it is no bag of this version, is encrypted, holds no message, or none that can be read.
        """
        layout = survey_bag(path)
        kinds = sorted({s.chunk.compression or "none" for s in layout.segments if s.chunk is not None})
        about = {
            "chunks": f"{sum(s.chunk is not None for s in layout.segments)} ({', '.join(kinds) or 'none'})",
            "index": "yes" if layout.has_footer else "no",
        }
        return log_of(BagMessages(layout), "ROS 1 bag", about)


READER = Rosbag1Reader()
