"""The commands of `vpltune`: each parses, calls the library and prints."""
