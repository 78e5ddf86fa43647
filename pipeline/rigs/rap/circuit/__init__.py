"""Physics of the circuit, its pumps, sensors, tank, housing and battery: plain functions in SI (rap.md, section 3)."""
