"""Rules: they turn the boat's state and the sets ahead into the stages of a horizon."""
