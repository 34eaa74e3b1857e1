"""Boats behind one page, `base.BoatLink`: simulated here, real ones beside it."""
