"""Write maps and plans in the formats of other programs."""
