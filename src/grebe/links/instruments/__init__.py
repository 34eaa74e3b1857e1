"""Sondes with their own connections, each read by a profile, at its own rate, in its own thread."""
