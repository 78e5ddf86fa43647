"""Flux density against coil current, B = B_s S(s0 I/B_s; p) + b_up or b_down (mre.md 3.3, T4), from the means of the holds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.separable import SeparableFit, covariance_of, fit_separable
from pipeline.rigs.mre.hold.law import LEAST_U, MOST_U, local_slope, saturating, saturation
from pipeline.rigs.mre.hold.record import Record

# Slope at the largest current over that at 0 A, and relative error, beyond which B_s is an extrapolation not told.
_FLAT, _WIDEST = 0.5, 0.1
_FEWEST = 6


@dataclass(frozen=True, eq=False)
class FieldFit:
    """B(I) of one run. `values`: ln_I_b (I_b = B_s/s0), u = 1/p, s0 and the remanences; order of `covariance` in `free`.

    `rows` tells which holds entered; `rest` is measured less model there, T.
    """

    run: str
    current: np.ndarray
    direction: np.ndarray
    flux: np.ndarray
    sd: np.ndarray
    values: dict[str, float]
    free: tuple[str, ...]
    covariance: np.ndarray
    rest: np.ndarray
    chi2: float
    dof: float
    curved: bool

    @property
    def B_s(self) -> float:
        """Limit of the flux density, T."""
        return self.values["s0"] * math.exp(self.values["ln_I_b"])

    @property
    def sharpness(self) -> float:
        """Sharpness p of the field's bend."""
        return 1 / self.values["u"]

    def at(self, current: np.ndarray, down: bool) -> np.ndarray:
        """Return B, T, at a current on the sweep up or down."""
        x = saturating(np.asarray(current, dtype=float), math.exp(self.values["ln_I_b"]), self.values["u"])[0]
        own = "b_down" if down else "b_up"
        other = "b_up" if down else "b_down"
        return np.asarray(self.values["s0"] * x + self.values.get(own, self.values.get(other, 0.0)))

    def flux_at(self, current: float, down: bool = False) -> tuple[float, float]:
        """Return B and its standard error, T."""
        x, by_log, by_u = (
            float(v[0]) for v in saturating(np.array([current]), math.exp(self.values["ln_I_b"]), self.values["u"])
        )
        s0 = self.values["s0"]
        b = "b_down" if down and "b_down" in self.values else "b_up" if "b_up" in self.values else "b_down"
        return float(self.at(np.array([current]), down)[0]), self._sd(
            {"s0": x, "ln_I_b": s0 * by_log, "u": s0 * by_u, b: 1.0}
        )

    def _sd(self, gradient: dict[str, float]) -> float:
        g = np.array([gradient.get(name, 0.0) for name in self.free])
        return math.sqrt(max(float(g @ self.covariance @ g), 0.0))

    def estimates(self) -> list[Estimate]:
        """Return s0, B_s, its sharpness, and the remanence of each direction."""
        dof = self.dof
        told = [estimate("flux_slope", self.values["s0"], self._sd({"s0": 1.0}), dof=dof)]
        top = float(np.abs(self.current).max())
        sd = self._sd({"s0": self.B_s / self.values["s0"], "ln_I_b": self.B_s})
        flat = float(local_slope(top / math.exp(self.values["ln_I_b"]), self.sharpness))
        reached = float(saturation(np.array([top / math.exp(self.values["ln_I_b"])]), self.sharpness)[0])
        share = f"{100 * reached:.0f} % of it reached at {top:.3g} A"
        if not self.curved:
            told.append(
                undetermined("flux_saturation", f"the field rises straight to the end of the sweep, {top:.3g} A")
            )
        elif flat > _FLAT or sd > _WIDEST * abs(self.B_s):
            told.append(
                undetermined(
                    "flux_saturation",
                    f"the field only begins to saturate: {share} by a law that the sweep does not test",
                )
            )
        else:
            told.append(estimate("flux_saturation", self.B_s, sd, dof=dof, logarithmic=True, reason=share))
        told += [
            estimate("remanence", self.values[key], self._sd({key: 1.0}), dof=dof, at={"sweep": key[2:]})
            for key in ("b_up", "b_down")
            if key in self.values
        ]
        return told


def fit_field(record: Record) -> FieldFit | None:
    """Fit the field of a run; None where it has too few holds with a field.

    The scatter of the holds about the law, where it is larger than their samples explain, sets the errors.
    """
    means = record.of("flux_density")
    if means is None:
        return None
    there = np.isfinite(means.mean)
    if there.sum() < _FEWEST:
        return None
    current, direction, flux = record.level[there], record.direction[there], means.mean[there]
    slope = float(np.ptp(flux)) / max(float(np.ptp(current)), 1e-9)
    own = (means.spread**2 / np.maximum(means.count, 1))[there]
    white = own + (slope * record.level_error[there]) ** 2
    ways = [key for key, sign in (("b_up", 1), ("b_down", -1)) if (direction == sign).sum() >= 2]
    sd = np.sqrt(white)
    for _ in range(3):
        fit, straight = _fit(current, direction, flux, sd, ways)
        spare = max(current.size - len(ways) - 3, 1)
        rest = fit.residual * sd
        # An error of the current moves B by the slope of the law there: not at all where it is saturated.
        slope_there = fit.c[0] * local_slope(current / math.exp(fit.q[0]), 1 / float(fit.q[1]))
        white = own + (slope_there * record.level_error[there]) ** 2
        scatter2 = max(float((rest**2).sum()) / spare - float(white.mean()), 0.0)
        sd = np.sqrt(white + scatter2)
    fit, straight = _fit(current, direction, flux, sd, ways)
    curved = straight - fit.chi2 > 12.0
    names = ("ln_I_b", "u", "s0", *ways)
    bound = {name for name, there_ in zip(names[:2], fit.at_bound, strict=True) if there_}
    if not curved:
        bound = {"ln_I_b", "u"}
    kept = [i for i, name in enumerate(names) if name not in bound]
    covariance, _ = covariance_of(fit.jacobian[:, kept])
    values = dict(zip(names, [*fit.q.tolist(), *fit.c.tolist()], strict=True))
    return FieldFit(
        record.run,
        current,
        direction,
        flux,
        sd,
        values,
        tuple(names[i] for i in kept),
        covariance,
        fit.residual * sd,
        fit.chi2,
        float(max(current.size - len(kept), 1)),
        curved,
    )


def _fit(
    current: np.ndarray, direction: np.ndarray, flux: np.ndarray, sd: np.ndarray, ways: list[str]
) -> tuple[SeparableFit, float]:
    """Return the best fit of the law and the misfit of a straight one."""
    member = np.stack([(direction == (1 if key == "b_up" else -1)).astype(float) for key in ways], axis=1)
    if member.shape[1] == 1:
        member[:] = 1.0  # the turn belongs to the only direction there is
    top = float(np.abs(current).max())

    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, by_log, by_u = saturating(current, math.exp(q[0]), float(q[1]))
        A = np.column_stack([x, member])
        dA = np.zeros((2, *A.shape))
        dA[0, :, 0], dA[1, :, 0] = by_log, by_u
        return A, dA

    ends = [
        fit_separable(
            columns,
            flux,
            np.array([math.log(share * top), u]),
            lower=np.array([math.log(0.02 * top), LEAST_U]),
            upper=np.array([math.log(30 * top), MOST_U]),
            scale=np.array([0.1, 0.05]),
            weights=1 / sd,
            tolerance=1e-12,
        )
        for share in (0.5, 0.9, 1.5)
        for u in (0.1, 0.4)
    ]
    straight = np.column_stack([current, member]) / sd[:, None]
    rest = flux / sd - straight @ np.linalg.lstsq(straight, flux / sd, rcond=None)[0]
    return min(ends, key=lambda end: end.chi2), float(rest @ rest)


def measured_at_zero(record: Record) -> tuple[float | None, float | None, float]:
    """Return the mean B at 0 A before and after the field was on, T, and the largest current before, A.

    None where the current is not held at 0 A then.
    """
    means = record.of("flux_density")
    if means is None:
        return None, None, 0.0
    zero = (np.abs(record.level) < 0.05) & np.isfinite(means.mean)
    seen = np.maximum.accumulate(np.abs(record.level))
    before, after = zero & (seen < 0.05), zero & (seen > 0.5)
    largest = float(seen[after][0]) if after.any() else 0.0
    return (
        float(means.mean[before].mean()) if before.any() else None,
        float(means.mean[after][0]) if after.any() else None,
        largest,
    )
