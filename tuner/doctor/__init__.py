"""Checks of the machine that vpltune doctor runs."""
