"""The checks behind `vpltune doctor`: which of the required libraries work on this machine."""
