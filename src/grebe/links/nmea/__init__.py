"""A boat that speaks NMEA 0183 and takes its thrusts as lines of JSON."""
