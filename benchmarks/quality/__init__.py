"""Benchmarks of image quality."""
