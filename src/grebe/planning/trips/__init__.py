"""Trips from harbours and back, each as long as a battery lasts."""
