"""From water to cells: lattices, and the pieces of tiles that lie in it."""
