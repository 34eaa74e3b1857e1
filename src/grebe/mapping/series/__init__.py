"""Several surveys of one water: what changed between two, and the trend of more."""
