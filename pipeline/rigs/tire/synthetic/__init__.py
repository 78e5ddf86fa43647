"""The synthetic tire, whose truth is known."""
