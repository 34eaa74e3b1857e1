"""Readers for files from outside, exporters for other programs, and the survey file."""
