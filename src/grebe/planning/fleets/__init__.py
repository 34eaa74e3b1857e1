"""A survey shared out among boats, alike or not."""
