"""Comparison of the pins' edges with the ideal motion."""
