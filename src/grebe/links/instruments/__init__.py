"""Sondes apart from the boat: read by a profile, at their own rate, in threads of their own."""
