"""Measurements during a mission: when a reading is due, and where it belongs."""
