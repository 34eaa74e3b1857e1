"""The true world of a simulation: boat, water and sonde."""
