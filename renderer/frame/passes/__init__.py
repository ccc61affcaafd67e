"""One technique, one file, shaders of the same name; passes never import each other."""
