"""The controller: rules write a horizon, one parametric problem is solved for it."""
