"""A run once it has been read: named channels in SI, streams, conditions, provenance."""

from pipeline.recording.recording import (
    Channel,
    Condition,
    Level,
    Provenance,
    QualityFinding,
    Recording,
    SourceFile,
    Stream,
)

__all__ = [
    "Channel",
    "Condition",
    "Level",
    "Provenance",
    "QualityFinding",
    "Recording",
    "SourceFile",
    "Stream",
]
