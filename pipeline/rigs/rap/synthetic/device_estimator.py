"""How the synthetic device itself follows its tank and regulates the volume: it is the device, not our identification.

A filter of volume and pump gain in plain numbers, fed once a second with what the device measures; the real one is not
published.
"""

from __future__ import annotations

_LEVEL_VARIANCE = 1.5e-3**2
_START_VOLUME, _START_GAIN = 5e-6**2, 0.15**2
_VOLUME_WANDER, _GAIN_WANDER = 0.05e-6**2, 0.02**2 / 3600.0
_GATE = 9.0
_LOST_AFTER = 60
_LOST_VOLUME = 0.2e-3**2


class DeviceEstimator:
    """Volume in the tank (m^3) and gain of the ultrafiltrate pump, from commands (m^3/s) and heights (m) once a second."""

    def __init__(self, area: float, volume: float) -> None:
        self.area = area
        self.volume, self.gain = volume, 1.0
        self._pvv, self._pvs, self._pss = _START_VOLUME, 0.0, _START_GAIN
        self._rejected = 0

    def pumped(self, command: float) -> None:
        """Take it that the pump was asked for `command` (m^3/s) for a second."""
        self.volume += self.gain * command
        self._pvv += command * (2.0 * self._pvs + command * self._pss) + _VOLUME_WANDER
        self._pvs += command * self._pss
        self._pss += _GAIN_WANDER

    def seen(self, height: float) -> None:
        """Correct by the liquid's height at the centroid (m); what is far off is not believed for a minute."""
        innovation = self.area * height - self.volume
        noise = self.area**2 * _LEVEL_VARIANCE
        if innovation**2 > _GATE * (self._pvv + noise):
            self._rejected += 1
            if self._rejected > _LOST_AFTER:
                self._pvv += _LOST_VOLUME
            return
        self._rejected = 0
        share = self._pvv / (self._pvv + noise)
        to_gain = self._pvs / (self._pvv + noise)
        self.volume += share * innovation
        self.gain += to_gain * innovation
        self._pss -= to_gain * self._pvs
        self._pvs *= 1.0 - share
        self._pvv *= 1.0 - share

    def emptied(self) -> None:
        """Start again at nothing: the key for draining was pressed."""
        self.volume, self._pvv, self._pvs, self._rejected = 0.0, _START_VOLUME, 0.0, 0
