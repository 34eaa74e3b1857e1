"""Campaigns: very many simulated missions, and what they allow to be claimed of the next one."""
