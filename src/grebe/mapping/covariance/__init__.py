"""How similar the water is at two places: covariance models and their fits."""
