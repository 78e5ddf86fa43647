"""How far the boards' clocks lie apart, found from what both see."""
