"""Fitting: the least-squares problem, its descent, and how certain the result is."""
