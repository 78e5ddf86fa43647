"""Roller passages of the blood pump: their frequency, the harmonics of any channel there, when the pump turns."""
