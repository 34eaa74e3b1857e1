"""Read files from outside into plain records."""
