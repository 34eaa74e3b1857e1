"""How good a map is: left-out readings are predicted, and standard deviations checked by them."""
