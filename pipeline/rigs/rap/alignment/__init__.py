"""How the clocks of device, bench and scale stand to each other: lag, rate, poles of the sensors."""
