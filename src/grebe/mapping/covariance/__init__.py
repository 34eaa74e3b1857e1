"""How alike the water is at two places: models, and how they are fitted."""
