"""Logs without noise, as simulations give them: the misfit is the arithmetic's, and no reason to reject."""

from __future__ import annotations

import pytest

from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.synthetic import ShearTruth

NOISELESS = {
    "preload_runs": False,
    "duration": 1.5,
    "force_noise": 0.0,
    "displacement_noise": 0.0,
    "hum": 0.0,
    "jitter": 0.0,
    "dropouts": 0.0,
}


@pytest.mark.parametrize("lsb", [(0.0, 0.0), (2000 / 65536, 1e-2 / 65536)], ids=["exact", "quantised"])
@pytest.mark.thorough
def test_noiseless_logs_are_not_rejected_and_give_the_truth(lsb: tuple[float, float]) -> None:
    recordings = SHEAR.synthesize({**NOISELESS, "force_lsb": lsb[0], "displacement_lsb": lsb[1]}, 1)
    findings = SHEAR.identify(recordings, ShearSettings(), Context("noiseless", {}))
    assert findings.verdict != "rejected"
    truth = ShearTruth()
    for name in ("k1", "k2", "rho", "c_bw", "n_bw"):
        assert findings.one(name).value == pytest.approx(getattr(truth, name), rel=5e-4)
