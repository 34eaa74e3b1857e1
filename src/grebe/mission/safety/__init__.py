"""Safety as states with reasons: pure functions that say at every estimate what a boat may do."""
