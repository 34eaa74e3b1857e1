"""The whole way as functions with plain arguments: what every front end calls."""
