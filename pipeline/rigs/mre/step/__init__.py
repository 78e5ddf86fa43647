"""Response of the axial force to steps of the coil current at a fixed gap (mre.md T3)."""
