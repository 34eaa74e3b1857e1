"""Solvers of the optimal control problem, behind one small interface."""
