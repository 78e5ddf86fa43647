"""The bench experiment: load and speed sweeps of one tire, from averaged waveforms to ring, sensors and calibration."""
