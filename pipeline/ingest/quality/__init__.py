"""Quality of what was logged, judged block by block while it passes: see `StreamQuality`."""

from pipeline.ingest.quality.channel import ChannelSummary
from pipeline.ingest.quality.stream import StreamQuality, StreamSummary, of_run
from pipeline.ingest.quality.summing import summed

__all__ = ["ChannelSummary", "StreamQuality", "StreamSummary", "of_run", "summed"]
