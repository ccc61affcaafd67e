"""What every benchmark needs: rows, the registry, scenes, the machine."""
