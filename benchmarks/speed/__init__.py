"""Benchmarks of speed: fits, batches, the surrogate and the passes of a frame."""
