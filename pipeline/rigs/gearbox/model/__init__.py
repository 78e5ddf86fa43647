"""Plain physics of the gearbox: teeth, speeds, torques, friction, equations of motion (gearbox.md, section 3)."""
