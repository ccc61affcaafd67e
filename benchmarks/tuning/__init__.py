"""Benchmarks of fits, of searches that compete with them, and of the learnt prior."""
