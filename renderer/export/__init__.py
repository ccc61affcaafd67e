"""Exports for other programs: scene bundle, web page, shader constants, glTF."""
