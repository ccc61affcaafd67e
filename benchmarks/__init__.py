"""The benchmarks of a checkout, run by `vpltune bench NAME`.

A benchmark is a module in `benchmarks/speed`, `benchmarks/quality` or `benchmarks/tuning` with a function
`rows(progress) -> Iterable[Row]`. Its name is the module's name. `benchmarks.harness.registry` finds
benchmarks, and `benchmarks/harness` holds what they share.
"""

from benchmarks.harness.registry import benchmark_names, run_benchmark

__all__ = ["benchmark_names", "run_benchmark"]
