"""Boats with a MAVLink autopilot, ArduPilot or PX4, and a stand-in autopilot for rehearsals."""
