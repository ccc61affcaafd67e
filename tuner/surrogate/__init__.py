"""The JAX surrogate: differentiable twins of the runtime's VPL gather and visibility maps."""
