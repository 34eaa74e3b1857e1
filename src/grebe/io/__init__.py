"""Files: read from outside, written for others, and the survey file."""
