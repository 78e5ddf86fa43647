"""Odd currents of a hold test: negative with the field, one level, ramps between the holds, swapped with the force."""

from __future__ import annotations

import numpy as np
import pytest
from hold_logs import changed, hold, said

from pipeline.errors import InputError
from pipeline.rigs.mre.hold.synthetic import synthesize


def test_a_field_that_is_negative_with_the_current_is_turned_with_it() -> None:
    recording = synthesize({}, 3)[0]
    for name in ("current", "flux_density"):
        recording = changed(recording, name, lambda _t, x: -x)
    found = hold([recording])
    assert found.one("flux_slope").value == pytest.approx(0.158, rel=0.01)
    assert not said(found, "probe turned round")
    assert said(found, "current is negative")


def test_a_current_at_one_level_is_refused() -> None:
    flat = changed(
        synthesize({}, 3)[0], "current", lambda t, _x: 3 + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    )
    with pytest.raises(InputError, match="stands at"):
        hold([flat])


def test_slow_ramps_are_no_short_holds() -> None:
    found = hold([synthesize({"ramp": 3.0}, 5)[0]])
    assert not said(found, "the holds last")
    assert found.one("force_gain").value == pytest.approx(0.65, abs=5e-3)


def test_current_and_force_swapped_are_named() -> None:
    recording = synthesize({}, 3)[0]
    force, current = recording.values("force_axial"), recording.values("current")
    swapped = changed(changed(recording, "current", lambda _t, _x: force), "force_axial", lambda _t, _x: current)
    with pytest.raises(InputError, match="swapped"):
        hold([swapped])


def test_a_clock_in_milliseconds_is_doubted() -> None:
    recording = synthesize({}, 3)[0]
    (stream,) = recording.streams.values()
    from dataclasses import replace

    slow = replace(recording, streams={stream.name: replace(stream, time=1e3 * stream.time)})
    assert said(hold([slow]), "ms taken as s")
