"""What a map is worth: what is left out is predicted, and standard deviations are held to it."""
