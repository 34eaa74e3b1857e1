"""From an outline to ordered target sets: region, mesh, route."""
