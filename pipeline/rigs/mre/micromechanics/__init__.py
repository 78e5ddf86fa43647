"""What a field adds to the shear modulus of an elastomer with chains of iron particles (mre.md 3.1, eqs 1-9)."""
