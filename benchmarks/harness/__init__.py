"""What benchmarks share: rows, the registry, scenes, and the description of the machine."""
