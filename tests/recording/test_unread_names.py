"""Names of channels are known without reading their samples."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream, storage


def test_names_of_a_lazily_read_recording_read_no_samples(tmp_path, monkeypatch):
    time = np.arange(5.0)
    channels = {name: Channel(name, np.sin(time), "N") for name in ("force_u", "force_v")}
    paths = storage.write(Recording("r1", {"": Stream("", time, channels)}), tmp_path)
    recording = storage.read(paths, lazily=True)
    monkeypatch.setattr(storage, "_columns", None)
    assert recording.names == ["force_u", "force_v"]
    assert "force_u" in recording
    with pytest.raises(InputError, match=r"has no channel .speed.; it has force_u"):
        recording.stream_of("speed")
