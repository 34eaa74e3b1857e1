"""From water to cells: lattices of tiles, and the pieces of tiles within the water."""
