"""Fitting: the least-squares problems, the descent that solves them, and the uncertainty of the result."""
