"""Safety: pure functions that decide at every estimate what a boat may do, and give the reason."""
