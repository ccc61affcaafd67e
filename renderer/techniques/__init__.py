"""Other ways to one-bounce light, for benchmarks and tests; none is part of the frame."""
