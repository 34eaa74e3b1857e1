"""Boats whose autopilot speaks MAVLink: ArduPilot's and PX4's, and a stand-in for rehearsals."""
