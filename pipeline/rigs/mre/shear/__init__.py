"""`mre.shear`: harmonic or random shear of the pads (T5, T6)."""
