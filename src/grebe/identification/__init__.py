"""Know your boat: masses, drags and thrusters from a drive with commands, and the drive for it."""
