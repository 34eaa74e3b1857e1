"""Boat links: simulated and real boats behind one interface, `base.BoatLink`."""
