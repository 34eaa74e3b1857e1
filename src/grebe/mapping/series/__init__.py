"""Several surveys of one water: the change between two, and the trend over more."""
