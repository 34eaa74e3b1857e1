"""The mission: one loop, its events, and who records them."""
