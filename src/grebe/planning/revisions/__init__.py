"""Replanning the rest of an order while a boat sails."""
