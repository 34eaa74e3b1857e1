"""Sharing a survey out among boats, alike or not."""
