"""Fit a whole library of scenes, on one machine or a cluster. Each scene gets a record and a tuned config."""
