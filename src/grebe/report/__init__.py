"""Figures, and the report page for the lake's manager."""
