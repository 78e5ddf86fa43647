"""ROS 2 bags in SQLite: `READER` reads them; those in MCAP are read by `pipeline.ingest.mcap_log`."""

from pipeline.ingest.rosbag2.reader import READER

__all__ = ["READER"]
