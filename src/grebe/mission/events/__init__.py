"""The events of a mission, and their receivers: recorders that store them, and listeners."""
