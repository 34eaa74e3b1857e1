"""Identification of a boat's masses, drags and thrusters from a drive, and the drive for it."""
