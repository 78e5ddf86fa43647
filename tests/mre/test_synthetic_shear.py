from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.mre.synthetic import shear_runs, shear_truth, synthesize_rich, synthesize_shear

FEW = {"campaign": "smallest", "preload_runs": False, "duration": 1.0}


def test_campaign_is_the_one_of_the_sheet() -> None:
    runs = shear_runs(shear_truth({}))
    assert len(runs) == 16
    amplitudes = {(run.current, run.frequency): run.amplitude for run in runs if run.test == "shear"}
    assert amplitudes[0.0, 5.0] == 2e-4
    assert amplitudes[2.0, 5.0] == 4e-4
    assert amplitudes[6.0, 15.0] == 6e-4
    assert [(run.preload, run.current) for run in runs if run.test == "preload"] == [
        (200.0, 0.0), (200.0, 6.0), (700.0, 0.0), (700.0, 6.0)
    ]  # fmt: skip
    assert [run.amplitude for run in shear_runs(shear_truth(FEW))] == [6e-4, 2e-4, 2e-4, 6e-4]


def test_recordings_carry_channels_units_and_conditions() -> None:
    for recording in synthesize_shear(FEW, 1):
        assert {channel.name: channel.unit for channel in recording} == {
            "displacement": "m",
            "force": "N",
            "current": "A",
        }
        assert {"test", "coil_current", "preload", "frequency", "n_pads", "pad_diameter", "pad_height"} <= {
            *recording.conditions
        }
        time, values = recording.signal("force")
        assert np.all(np.diff(time) > 0)
        assert values.size == time.size == pytest.approx(5000, abs=15)
        assert recording.stream_of("force").rate == pytest.approx(5000)


def test_same_seed_same_logs_other_seed_others() -> None:
    first, again, other = (synthesize_shear(FEW, seed)[0].values("force") for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:4000], other[:4000])


@pytest.mark.thorough
def test_noise_lag_and_gain_are_what_was_asked() -> None:
    quiet = {**FEW, "hum": 0.0, "jitter": 0.0, "dropouts": 0.0, "force_offset": 0.0, "force_lsb": 0.0}
    loud, still = (synthesize_shear({**quiet, "force_noise": noise}, 1)[0] for noise in (1.0, 0.0))
    difference = loud.values("force") - still.values("force")
    assert difference.std() == pytest.approx(1.0, rel=0.05)
    gains = []
    for seed in range(12):
        plain, scattered = (
            synthesize_shear({**quiet, "force_noise": 0.0, "gain_scatter": s}, seed)[0].values("force")
            for s in (0.0, 0.02)
        )
        gains.append(float(plain @ scattered / (plain @ plain)) - 1)
    assert np.std(gains) == pytest.approx(0.02, rel=0.5)


def test_quantisation_and_dropouts() -> None:
    recording = synthesize_shear({**FEW, "dropouts": 0.05}, 3)[0]
    time, force = recording.signal("force")
    steps = force / (2000 / 65536)
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    assert time.size == pytest.approx(0.95 * 5000, rel=0.02)


def test_tables_may_come_with_text_keys() -> None:
    truth = shear_truth({"k_mr": {"2": 1e5, "6": 3e5}})
    assert truth.k_mr_at(6.0) == 3e5
    assert truth.k_mr_at(0.0) == 0.0
    assert truth.k_mr_at(4.0) == 2e5


def test_misspelt_parameter_names_the_nearest() -> None:
    with pytest.raises(InputError, match="alpha_bw"):
        synthesize_shear({"alpha_bv": 3.0}, 1)
    with pytest.raises(InputError, match="full, smallest or none"):
        synthesize_shear({"campaign": "huge"}, 1)


def test_rich_record_sweeps_frequency_and_amplitude() -> None:
    recording = synthesize_rich({}, 1, current=2.0, duration=20.0)
    time, x = recording.signal("displacement")
    time, x = (v[: v.size // 25 * 25].reshape(-1, 25).mean(axis=1) for v in (time, x - x.mean()))
    crossings = [np.count_nonzero(np.diff(np.sign(x[(time >= a) & (time < a + 2)]))) / 4 for a in (0.0, 18.0)]
    assert crossings[0] == pytest.approx(3.7, abs=1.2)
    assert crossings[1] == pytest.approx(16.3, abs=1.2)
    assert np.abs(x).max() == pytest.approx(6e-4, rel=0.1)
    assert recording.condition("coil_current") == 2.0
