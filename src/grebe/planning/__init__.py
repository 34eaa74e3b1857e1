"""Planning: from an outline to ordered target sets, by region, mesh and route."""
