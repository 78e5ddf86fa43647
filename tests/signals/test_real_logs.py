"""Logs of real machines, read with as little as possible: what kind of motion do they hold?"""

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from pipeline.estimation.harmonic import fundamental
from pipeline.signals.periodicity import classify


@pytest.mark.parametrize("name", ["ensaio.A.1.mat", "ensaio.A.3.mat"])
def test_a_shaken_damper_is_periodic_with_a_drifting_mean(realdata, name):
    log = loadmat(realdata / "mr_damper_sine" / name)
    time, distance = log["Tout"].ravel(), log["dist"].ravel()
    found = classify(time, distance)
    assert found.kind == "periodic"
    assert found.steady_cycles >= 9
    assert any("mean drifts" in remark for remark in found.remarks)
    inside = (time >= found.steady[0]) & (time <= found.steady[1])
    assert fundamental(time[inside], distance[inside]).value == pytest.approx(found.frequency, rel=2e-3)


def test_the_still_first_two_seconds_are_seen(realdata):
    log = loadmat(realdata / "mr_damper_sine" / "ensaio.A.1.mat")
    found = classify(log["Tout"].ravel(), log["dist"].ravel())
    assert found.still_before == pytest.approx(2.0, abs=0.1)
    assert found.still_after == 0


@pytest.mark.parametrize("name", ["0d01_1d5", "0d03_1d5_1", "0d03_2d0_1", "0d05_1d5_1"])
def test_one_load_unload_ramp_is_half_a_cycle(realdata, name):
    table = pd.read_csv(realdata / "vhb4910" / f"{name}.csv", encoding="gb18030", skiprows=[1])
    found = classify(*table.iloc[:, :2].to_numpy(float).T)
    assert (found.kind, found.strokes) == ("half_cycle", 2)


def test_a_randomly_driven_damper_is_not_periodic(realdata):
    table = pd.read_csv(realdata / "mr_damper_random" / "ranran_50_converted.csv")
    for channel in "DVF":
        found = classify(table["t"].to_numpy(), table[channel].to_numpy())
        assert found.kind == "non_periodic"
    resting = classify(table["t"].to_numpy(), table["D"].to_numpy())
    assert resting.still_after == pytest.approx(3.4, abs=0.2)
    assert np.all(np.array(resting.band) < 60)
