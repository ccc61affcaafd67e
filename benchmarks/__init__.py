"""Benchmarks, run by `vpltune bench NAME` from a checkout.

A benchmark is a module of this folder with a function `rows(progress) -> list[Row]`; its name is
the module's. `benchmarks.harness.registry` finds them.
"""

from benchmarks.harness.registry import benchmark_names, run_benchmark

__all__ = ["benchmark_names", "run_benchmark"]
