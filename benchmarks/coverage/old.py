"""What the coverage studies share: do 95 % intervals hold the truth 95 times in 100?

A study hands over, by name, every estimate beside its truth; the table tells how often its interval held
it, bias over mean standard error, actual over claimed spread, and the rms error.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate

Pairs = Sequence[tuple[Estimate, float]]


def parser(doc: str, seeds: int = 100) -> argparse.ArgumentParser:
    """Return a parser with the number of seeds and the first one."""
    made = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("seeds", nargs="?", type=int, default=seeds)
    made.add_argument("--first", type=int, default=0, help="first seed")
    return made


def seeds_of(arguments: argparse.Namespace) -> range:
    """Return the seeds asked for."""
    return range(arguments.first, arguments.first + arguments.seeds)


def share_covered(pairs: Pairs) -> float:
    """Return the share of determined estimates whose interval holds the truth; NaN if there is none."""
    held = [e.ci95[0] <= truth <= e.ci95[1] for e, truth in pairs if e.ci95 is not None]
    return float(np.mean(held)) if held else float("nan")


def table(found: Mapping[str, Pairs], units: Mapping[str, tuple[float, str]] | None = None) -> str:
    """Return one line a name.

    Parameters
    ----------
    found
        Estimates and their truths, by name.
    units
        Names whose rms error is not told in per cent of the truth: what one unit is in SI, and its name.
    """
    width = max(24, *(len(name) for name in found)) if found else 24
    lines = [f"{'':{width}} {'covered':>12} {'bias/se':>8} {'spread/se':>9} {'rms error':>10}   undetermined"]
    for name, pairs in found.items():
        known = [(e, t) for e, t in pairs if e.value is not None and e.ci95 is not None]
        error = np.array([float(e.value or 0.0) - t for e, t in known])
        sd = np.array([e.std_error if e.std_error else np.nan for e, _ in known])
        one, unit = (units or {}).get(name, (None, "%"))
        size = np.array([one or 0.01 * abs(t) or np.nan for _, t in known])
        z = (error / sd)[np.isfinite(error / sd)]
        bias, spread = (f"{z.mean():8.2f}", f"{z.std():9.2f}") if z.size else (f"{'':8}", f"{'':9}")
        rms = float(np.sqrt(np.mean((error / size) ** 2))) if known else np.nan
        covered = round(share_covered(pairs) * len(known)) if known else 0
        none = len(pairs) - len(known) or ""
        lines.append(f"{name:{width}} {covered:5d} of {len(known):<4d} {bias} {spread} {rms:8.3g} {unit:3} {none}")
    return "\n".join(lines)
