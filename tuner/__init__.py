"""The tuner: fits the runtime's parameters to a path tracer, by gradient descent."""
