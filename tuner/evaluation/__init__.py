"""Evaluation: views with their references, and the measures by which a fit is accepted or rejected."""
