"""Orders of the cells: first orders, their costs, their improvement, and bounds."""
