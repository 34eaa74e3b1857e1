"""What readings say of every place: kriging, and the field that knows the shore."""
