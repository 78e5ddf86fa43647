"""Coverage of `mre.shear`: the full campaign and the four runs of the preload test, 16 logs.

The bound is that of the likelihood of the harmonics of the 14 runs at 200 N: noise of its true colour on both signals, gains of the runs
normally distributed with the true scatter, all other parameters free.

Loop metrics of all runs count together; they have no bound, since they are read from the loops without a model. Logs last 2 s,
the search has 2 starts in place of 6 and the force is tared, so that no mass is looked for: that saves time.

The scatter of the gains has about 8 degrees of freedom here, and Student's t that goes with it: the standard errors scatter, so
that the spread of error over standard error lies above 1 for k_mr, k2 and most for the scatter itself, whose error is in
proportion to its value. Their intervals allow for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.coverage.dirt import coloured
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.estimation.scatter import gain_vectors, whitening
from pipeline.findings import Parameter
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel, Layout, Shape, real_rows
from pipeline.rigs.mre.model.loop import N_F, N_X
from pipeline.rigs.mre.pads import Pads
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.synthetic import ShearRun, shear_runs, shear_truth, synthesize_shear, true_loop

_SCATTER = 0.004
_COLOUR = {"displacement": 1e-6, "force": 0.7}
_MEMORY = 0.01  # s
_OVERRIDES = {"gain_scatter": _SCATTER, "duration": 2.0}
_SETTINGS = ShearSettings(starts=2, moving_mass=0.0)
_TRUTH = shear_truth(_OVERRIDES)
_RUNS = {run.name: run for run in shear_runs(_TRUTH)}
_PADS = Pads(diameter=0.05, height=0.006)
_EFFECTS = ("mr_effect_force", "mr_effect_amplitude")


def campaign(_case: str, seed: int) -> Campaign:
    """Return the logs of one campaign."""
    logs = synthesize_shear(_OVERRIDES, seed)
    dirty = coloured(logs, np.random.default_rng([seed, 1]), _COLOUR, _MEMORY)
    return Campaign(dirty, truth, settings=_SETTINGS, bound=lambda p: bounds().get((p.name, _current(p))), label=label)


def _current(parameter: Parameter) -> float:
    return float(parameter.at.get("coil_current", 0.0))


def label(parameter: Parameter) -> str:
    """Return the name with current and preload, but for what is told of each run."""
    if "run" in parameter.at or not parameter.at:
        return parameter.name
    where = f"{parameter.name} {_current(parameter):.0f} A"
    preload = parameter.at.get("preload")
    return where if preload is None else f"{where} {float(preload):.0f} N"


def truth(parameter: Parameter) -> float | None:
    """Return what a parameter should be."""
    name, at = parameter.name, parameter.at
    if "run" in at:
        return _metrics(str(at["run"]), float(at["frequency"]))[name]
    if name in _EFFECTS:
        return _effects(_current(parameter), round(float(at["preload"]), -2))[name]
    derived = {
        "tau": _TRUTH.s1 / _TRUTH.k1,
        "run_scatter": _TRUTH.gain_scatter,
        "k1_plus_k2": _TRUTH.k1 + _TRUTH.k2,
        "k2_plus_alpha_rho": _TRUTH.k2 + _TRUTH.alpha_bw * _TRUTH.rho,
    }
    if name == "k_mr":
        return _TRUTH.k_mr_at(_current(parameter))
    if name == "s_mr":
        return _TRUTH.s_mr_at(_current(parameter))
    return derived[name] if name in derived else float(getattr(_TRUTH, name))


@cache
def _metrics(run: str, frequency: float) -> Mapping[str, float]:
    return {e.name: float(e.value or 0.0) for e in loop_metrics(true_loop(_TRUTH, _RUNS[run], frequency), pads=_PADS)}


@cache
def _effects(current: float, preload: float) -> Mapping[str, float]:
    states = {run.current: run for run in _RUNS.values() if run.test == "preload" and run.preload == preload}
    without, with_ = states[0.0], states[current]

    def stiffness(run: ShearRun) -> float:
        return next(float(e.value or 0.0) for e in loop_metrics(true_loop(_TRUTH, run)) if e.name == "stiffness_secant")

    equal = replace(with_, amplitude=without.amplitude)
    return {
        "mr_effect_force": stiffness(with_) / stiffness(without) - 1,
        "mr_effect_amplitude": stiffness(equal) / stiffness(without) - 1,
    }


def _noise(frequency: np.ndarray, white: float, colour: float) -> np.ndarray:
    """Return the standard deviation of the real part of a harmonic at a frequency (Hz)."""
    n = _TRUTH.rate * _TRUTH.duration
    a = math.exp(-1 / (_TRUTH.rate * _MEMORY))
    turn = np.exp(-2j * np.pi * frequency / _TRUTH.rate)
    return np.asarray(np.sqrt(2 / n * (white**2 + colour**2 * (1 - a * a) / np.abs(1 - a * turn) ** 2)))


@cache
def bounds() -> Mapping[tuple[str, float], float]:
    """Return the bound on the standard error of each parameter of the dynamic model, by name and current (0 for none)."""
    orders = np.arange(1, N_F + 1)
    loops = []
    for run in (run for run in _RUNS.values() if run.preload == 200.0):
        loop = true_loop(_TRUTH, run)
        late = np.exp(-1j * orders * loop.omega * _TRUTH.force_lag)
        at = orders * run.frequency
        sd_x = np.where(orders <= 5, _noise(at, _TRUTH.displacement_noise, _COLOUR["displacement"]), 0.0)[:N_X]
        sd_f = _noise(at, _TRUTH.force_noise, _COLOUR["force"])
        loops.append(replace(loop, F=loop.F * late, sd_x=sd_x, sd_f=sd_f, kept=np.abs((at + 25) % 50 - 25) > 1))
    levels = tuple(_TRUTH.currents)
    layout = Layout("ks", tuple(levels.index(float(loop.current or 0.0)) for loop in loops), levels, 0)
    t = _TRUTH
    q = Shape(t.s1 / t.k1, t.rho, t.c_bw, t.n_bw, t.force_lag).search_point
    c = np.array([{"u": t.k1, "x": t.k2, "w": t.alpha_bw}[term.column] if term.level is None
                  else (t.k_mr_at if term.column == "x" else t.s_mr_at)(levels[term.level])
                  for term in layout.terms])  # fmt: skip
    model = HarmonicModel(loops, layout)
    model = HarmonicModel(loops, layout, blocks=model.noise_around(q, c))
    A, dA = model(q)
    columns = model.whitened(real_rows(np.hstack([(dA @ c).T, A])))
    V = gain_vectors(model.whitened(model.predicted(q, c)), model.groups)
    columns = whitening(V, _SCATTER)(columns)
    size = np.linalg.norm(columns, axis=0)
    covariance = np.linalg.inv((columns / size).T @ (columns / size)) / np.outer(size, size)
    sd = np.sqrt(np.diag(covariance))
    sd[:2] *= t.s1 / t.k1, t.rho
    names = [(name, 0.0) for name in ("tau", "rho", "c_bw", "n_bw", "force_lag", "k1", "k2", "alpha_bw")]
    field = {"x": "k_mr", "v": "s_mr"}
    names += [(field[term.column], levels[term.level]) for term in layout.terms if term.level is not None]
    found = dict(zip(names, sd.tolist(), strict=True))
    damper = np.zeros(sd.size)
    damper[[0, 5]] = t.s1, t.s1 / t.k1  # s1 = k1 exp(ln tau)
    return {**found, ("s1", 0.0): math.sqrt(float(damper @ covariance @ damper))}


STUDY = Study(
    SHEAR,
    {
        "standard": Case(
            "12 runs of 2 s, 3 frequencies, 4 currents and 3 amplitudes, and 4 of the preload test; gain scatter of 0.4 % from run to "
            "run, white noise of 1 N and 1.5 um, first-order noise of 0.7 N and 1 um with 10 ms memory, mains hum of 0.3 N, "
            "offsets, steps of the converters, clock jitter of 5 us, samples lost, force 60 us late."
        )
    },
    campaign,
)
