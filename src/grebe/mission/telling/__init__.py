"""What a mission says, and who hears it: recorders that keep it, listeners that watch."""
