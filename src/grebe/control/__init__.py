"""The controller: a rule writes the horizon, and one parametric problem is solved for it."""
