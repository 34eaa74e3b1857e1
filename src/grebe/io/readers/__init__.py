"""Files from outside, read into plain records."""
