"""Boats that send NMEA 0183 and receive thrusts as lines of JSON."""
