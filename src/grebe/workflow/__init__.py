"""The steps of a survey as functions with plain arguments, which every front end calls."""
