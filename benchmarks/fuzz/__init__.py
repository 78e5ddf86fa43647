"""Fuzzing of everything that reads what people and machines hand in; see `__main__`."""
