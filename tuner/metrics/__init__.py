"""Metrics: error measures of an image against its reference, and how an error is shown."""
