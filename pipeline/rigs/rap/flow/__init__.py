"""`rap.flow`: what the blood pump delivers, from the pulsation or the mean of the pressures; calibration and hold-out."""
