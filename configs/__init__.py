"""Presets and the schema of the config file, as package data."""
