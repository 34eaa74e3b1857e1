"""Missions: the loop that runs them, the events that it emits, and the recorders of these."""
