"""`tpjb.rotating`: orbits under a slowly rotating load, harmonics, linear and quadratic stiffness (tpjb.md T3).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Reference, Settings
from pipeline.rigs.tpjb.rig import CIULLI_FORTE_2019, CONDITIONS, OPERATING, channels
from pipeline.rigs.tpjb.rotating.equations import EQUATIONS


class RotatingSettings(Settings):
    """What a recipe of `tpjb.rotating` may set."""

    average: float | None = Field(
        None, gt=0, description="s, logs are averaged over it; by default a hundredth of a turn of the load"
    )
    least_turns: float = Field(3.0, ge=1, description="turns of the load that harmonics and THD ask for")
    thd_linear: float = Field(0.025, gt=0, lt=1, description="THD below which an orbit is called linear")
    thd_nonlinear: float = Field(0.05, gt=0, lt=1, description="THD above which it is called nonlinear; sets rho*")


_LINEAR = "eqs (3), (4), linear part"
_QUADRATIC = "eqs (3), (4), quadratic part"
_MIXED = "mixed term, not in the paper"
PARAMETERS = (
    ParameterSpec("kxx", "k_{xx}", "N/m", "stiffness, x force by x displacement", _LINEAR, key=True),
    ParameterSpec("kxy", "k_{xy}", "N/m", "stiffness, x force by y displacement", _LINEAR),
    ParameterSpec("kyx", "k_{yx}", "N/m", "stiffness, y force by x displacement", _LINEAR),
    ParameterSpec("kyy", "k_{yy}", "N/m", "stiffness, y force by y displacement", _LINEAR, key=True),
    ParameterSpec(
        "kxx2", "k_{xx2}", "N/m^2", "quadratic stiffness, x force by the square of x displacement", _QUADRATIC, key=True
    ),
    ParameterSpec(
        "kxy2", "k_{xy2}", "N/m^2", "quadratic stiffness, x force by the square of y displacement", _QUADRATIC
    ),
    ParameterSpec(
        "kyx2", "k_{yx2}", "N/m^2", "quadratic stiffness, y force by the square of x displacement", _QUADRATIC
    ),
    ParameterSpec(
        "kyy2", "k_{yy2}", "N/m^2", "quadratic stiffness, y force by the square of y displacement", _QUADRATIC, key=True
    ),
    ParameterSpec("kxxy", "k_{xxy}", "N/m^2", "mixed stiffness, x force by the product of the displacements", _MIXED),
    ParameterSpec("kyxy", "k_{yxy}", "N/m^2", "mixed stiffness, y force by the product of the displacements", _MIXED),
    ParameterSpec(
        "thd", r"\mathrm{THD}", "1", "harmonics that the load does not explain, over the 1X", "not in the paper"
    ),
    ParameterSpec("orbit_harmonic_x", "X_n", "m", "amplitude of the horizontal displacement, by order", "Fig. 8"),
    ParameterSpec("orbit_harmonic_y", "Y_n", "m", "amplitude of the vertical displacement, by order", "Fig. 8"),
    ParameterSpec("linear_limit", r"\rho^*", "1", "load ratio at which the THD is 5 %", "not in the paper", key=True),
)

OREAR_1982 = Reference(
    "orear1982",
    "J. Orear",
    "Least squares when both variables have uncertainties",
    "American Journal of Physics",
    1982,
    volume="50",
    pages="912-916",
)
SCHWARZ_1978 = Reference(
    "schwarz1978",
    "G. Schwarz",
    "Estimating the dimension of a model",
    "The Annals of Statistics",
    1978,
    volume="6",
    pages="461-464",
)


ROTATING = Experiment(
    id="tpjb.rotating",
    title="Orbits of a tilting pad bearing under a rotating load",
    summary="Linear and quadratic stiffness, orbit harmonics and the linear limit from a slowly turning force.",
    references=(CIULLI_FORTE_2019, OREAR_1982, SCHWARZ_1978),
    channels=channels("force_u", "force_v"),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=RotatingSettings,
    identify=Later("pipeline.rigs.tpjb.rotating.identify:identify"),
    synthesize=Later("pipeline.rigs.tpjb.rotating.synthetic:synthesize"),
    sections=Later("pipeline.rigs.tpjb.rotating.sections:sections"),
    methods=Later("pipeline.rigs.tpjb.rotating.methods:methods"),
    check=Later("pipeline.rigs.tpjb.rotating.faults:check"),
    advise=Later("pipeline.rigs.tpjb.rotating.advise:advise"),
    operating=OPERATING,
    builds_on=("tpjb.dynamic", "tpjb.bump"),
    signals=(
        Signals(
            "samples",
            {"fx": "N", "fy": "N", "x": "m", "y": "m", "mx": "m", "my": "m"},
            "force, journal motion and (mx, my) that of the selected model",
        ),
    ),
)
