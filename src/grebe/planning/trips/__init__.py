"""Trips from a harbour and back, each within what a battery lasts."""
