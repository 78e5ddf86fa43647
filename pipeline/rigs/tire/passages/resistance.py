"""From volts to R2: which leg of the divider the sensor is in, and which way it bends (tire.md, 3.3 and 5.1)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.ring.sensor import divider_resistance


def from_volts(volts: np.ndarray, VIN: float, R1: float, flipped: bool) -> np.ndarray:
    """Return R2, ohm; `flipped` where the sensor is in the upper leg, so that V = VIN R1/(R1 + R2)."""
    return divider_resistance(VIN - volts if flipped else volts, VIN, R1)


def in_upper_leg(waveform: np.ndarray, VIN: float, R1: float) -> bool:
    """Tell for peaks that point down which is the reason: the sensor's place in the divider, or the way it is bent.

    Curvature of a closed belt has no first harmonic (tire.md, 3.1), and only the true law gives R2 without one.

    Parameters
    ----------
    waveform
        Mean voltage of a revolution on even angles, shape (n,).
    """
    share = []
    for flipped in (False, True):
        R2 = from_volts(waveform, VIN, R1, flipped)
        if not np.all(np.isfinite(R2)):
            return not flipped
        spectrum = np.abs(np.fft.rfft(R2))
        share.append(float(spectrum[1] / np.ptp(R2)))
    return share[1] < share[0]
