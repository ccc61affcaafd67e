"""The commands of `vpltune`. Each one parses its arguments, calls the library and returns a report."""
