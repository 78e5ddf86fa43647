"""ROS 1 bags: `READER` reads them."""

from pipeline.ingest.rosbag1.reader import READER

__all__ = ["READER"]
