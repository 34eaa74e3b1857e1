"""Estimates at every place from readings: kriging, and the field that knows the shore."""
