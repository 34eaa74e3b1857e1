"""Campaigns: very many simulated missions, and the claims about the next one that they support."""
