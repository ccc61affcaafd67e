"""Evaluation: views, their references, and the measures that accept or reject a fit."""
