"""How large a scene may be, tested before anything is allocated: a kilobyte can ask for a terabyte."""

from vpltune.renderer.scene.files.diagnostics import SceneFileError

MAX_FILE_BYTES = 1 << 29
"""All files of a scene together. Half of the gibibyte that reading a scene may take."""

MAX_DECODED_BYTES = 1 << 29
"""Vertex and index arrays made from them. The other half: some six million flat-shaded triangles."""

MAX_JSON_VALUES = 2_000_000
"""Python needs about 100 bytes and half a microsecond for each."""

MAX_NODES = 1 << 17

MAX_INSTANCES = 10_000
"""Each is a draw call of its own in every pass."""

MAX_CHANNELS = 10_000
"""Of animations: each takes some 50 microseconds to read."""

MAX_IMAGE_SIDE = 16384
"""The smallest limit that OpenGL 4.3 lets a driver set."""

MAX_IMAGE_TEXELS = 1 << 26
MAX_SCENE_TEXELS = 3 << 26
"""Three bytes each, and seven while an image is unpacked."""

FREE_TEXELS = 1 << 26
TEXELS_PER_BYTE = 64
"""Beyond the free ones, texels must be paid for in bytes of image files: a photograph has two to ten
to the byte, a kilobyte that unpacks to a megabyte has hundreds."""

LARGEST_COORDINATE = 1e15
"""Its square still fits a float32, with eight decades to spare."""

SMALLEST_EXTENT = 1e-15
"""A scene less wide than this has float32 areas that round to zero."""

LARGEST_RADIOMETRIC = 1e18
"""Of a light's intensity: its product with any albedo and area stays finite in float32."""


class DecodedBytes:
    """What is left of MAX_DECODED_BYTES while one scene is read."""

    def __init__(self) -> None:
        self._left = MAX_DECODED_BYTES

    def spend(self, count: int, where: str) -> None:
        """Take `count` bytes.

        Raises:
            SceneFileError: fewer are left.
        """
        if count > self._left:
            raise SceneFileError(
                f"{where}: geometry must take at most {MAX_DECODED_BYTES >> 20} MiB once decoded, and this "
                f"needs {count >> 20} MiB with {self._left >> 20} MiB left"
            )
        self._left -= count
