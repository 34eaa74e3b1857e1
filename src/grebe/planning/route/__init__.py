"""Cells in order: first orders, what they cost, how they are made shorter, and bounds."""
