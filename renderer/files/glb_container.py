"""Constants of the .glb container (glTF 2.0, section 4.4)."""

GLB_MAGIC = b"glTF"
"""The first bytes of a file."""
JSON_CHUNK = 0x4E4F534A
"""Type of the first chunk: "JSON", little-endian."""
BINARY_CHUNK = 0x004E4942
"""Type of the second chunk, if it is the binary buffer: "BIN", little-endian."""
