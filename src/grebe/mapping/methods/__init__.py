"""The ways to make a map from readings: fit a method, then ask the field."""
