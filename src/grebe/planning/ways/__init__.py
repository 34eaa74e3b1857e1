"""Ways through the water: between cells, around land, home, and what they cost."""
