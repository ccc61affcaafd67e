"""One loss family, one file."""
