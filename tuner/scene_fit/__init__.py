"""The fit of one scene, from its views to the files that it writes."""
