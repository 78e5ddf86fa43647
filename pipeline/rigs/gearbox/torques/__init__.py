"""Zero offsets, nominal and peak torques, their drift and clipping, the torque map (5.2 to 5.4)."""
