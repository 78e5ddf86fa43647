"""The rolling radius of a campaign: the speed line, held against the tire's size; by the size where no speed was measured."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.campaign import BY_SIZE_U, Campaign
from pipeline.rigs.tire.bench.speed_faults import odd_radii
from pipeline.rigs.tire.bench.speed_line import expected_radius, speed_line

# A tire's rolling radius lies this close to the one by its size (relative).
_BELIEVED = 0.015
# Clocks that differ by more are told, by so many runs whose lengths differ by that share at least.
_CLOCKS, _FEWEST, _LENGTHS = 0.003, 3, 0.2


def roll(found: Campaign) -> None:
    """Fit the speed line, or take the radius by the tire's size."""
    odd = odd_radii(found.runs)
    found.findings += [QualityFinding("warning", text, name, "road_speed") for name, text in odd.items()]
    points = [run.point for run in found.runs if run.name not in odd and math.isfinite(run.point.speed)]
    diameter = 2.0 * found.tire.free_radius if found.tire.free_radius is not None else None
    if points:
        found.line = speed_line(points, diameter)
        value, error = found.line.radius.value, found.line.radius.std_error
        if value is not None and error is not None:
            found.radius, found.radius_u = value, error / value
            _compare_clocks(found)
            _hold_against_size(found)
            return
    if diameter is not None:
        found.radius = expected_radius(diameter)
    reasons = list(dict.fromkeys(run.reference.why_not.get("road_speed", "") for run in found.runs))
    found.no_line = f"no run has a road_speed that can be used ({listing([r for r in reasons if r], 3)})"
    text = (
        f"{found.no_line}: the rolling radius is not told, and the ring fit takes {1e3 * found.radius:.1f} mm by the tire's size (3.05 nominal "
        f"diameters a turn), {100 * BY_SIZE_U:g} % uncertain. Log the surface speed of drum or belt"
    )
    found.findings.append(QualityFinding("warning", text, None, "road_speed"))


def _compare_clocks(found: Campaign) -> None:
    """Doubt the clocks where the two tables of every run last differently by one factor: not by when they were started."""
    pairs = np.array([(run.device.duration, run.reference_length) for run in found.runs])
    pairs = pairs[np.isfinite(pairs).all(axis=1) & (pairs > 0.0).all(axis=1)]
    if len(pairs) < _FEWEST or np.ptp(pairs[:, 1]) < _LENGTHS * pairs[:, 1].min():
        return
    own, reference = pairs.T
    off = float(np.median(own / reference)) - 1.0
    as_factor, as_offset = np.std(own - (1.0 + off) * reference), np.std(own - reference)
    if abs(off) < _CLOCKS or as_factor > 0.2 * as_offset:
        return
    found.radius_u, found.clock_u = max(found.radius_u, abs(off)), max(found.clock_u, abs(off))
    text = (
        f"the transmitter's log lasts {100 * abs(off):.2f} % {'longer' if off > 0.0 else 'shorter'} than the bench's table in every run, whatever its length: one of the two clocks is off "
        "(sample_rate, or the stamps of the bench). Rolling radius and all times are taken to be that uncertain. Check sample_rate"
    )
    found.findings.append(QualityFinding("warning", text))


def _hold_against_size(found: Campaign) -> None:
    """Doubt a tire size that the rolling radius contradicts: it sets the scale of the ring."""
    free = found.tire.free_radius
    if free is None or abs(found.radius / expected_radius(2.0 * free) - 1.0) <= _BELIEVED:
        return
    found.size_doubted = True
    off = abs(found.radius / expected_radius(2.0 * free) - 1.0)
    found.radius_u, found.clock_u = max(found.radius_u, off), max(found.clock_u, off)
    text = (
        f"the tire rolls on {1e3 * found.radius:.1f} mm, and {found.tire.size} of free radius {1e3 * free:.1f} mm on about "
        f"{1e3 * expected_radius(2.0 * free):.1f} mm: tire_size, road_speed or the transmitter's clock (sample_rate) is wrong. "
        f"Which of them, nothing here tells: the rolling radius is taken to be {100 * off:.1f} % uncertain, and the ring fit takes {1e3 * found.free_radius:.1f} mm "
        "as free radius. Read the size off the side wall, and check speed and clock"
    )
    found.findings.append(QualityFinding("warning", text))
