"""The dynamic model of eqs (10)-(12): Bouc-Wen and a Maxwell branch; its fits to steady loops and to records in time."""
