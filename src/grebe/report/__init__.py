"""Pictures, and the page for the lake's manager."""
