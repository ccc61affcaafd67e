"""Benchmarks of fits, searches and the prior."""
