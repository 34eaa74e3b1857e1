"""Paths through the water: between cells, around land, home, and their costs."""
