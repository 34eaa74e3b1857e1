"""From samples to maps with their uncertainty: variogram, kriging, validation."""
