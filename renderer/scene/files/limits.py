"""Size limits of scenes, checked before memory is allocated: a file of a kilobyte can ask for a terabyte."""

from vpltune.renderer.scene.files.diagnostics import SceneFileError, mebibytes

MAX_FILE_BYTES = 1 << 29
"""A choice: all files of a scene together, half of the 1 GiB that reading a scene may take."""

MAX_DECODED_BYTES = 1 << 29
"""A choice: all vertex and index arrays, the other half. That is 4.07 million flat-shaded triangles of glTF.

Each takes 132 bytes: three corners with position, normal, uv and colour in single precision.
"""

MAX_JSON_BYTES = 1 << 27
"""A choice: JSON text in memory. File, text, a string of it and what that encodes lie side by side."""

MAX_JSON_VALUES = 2_000_000
"""A choice. Python needs about 100 bytes and 0.5 µs for each value."""

MAX_NODES = 1 << 17
"""A choice: nodes of a glTF document."""

MAX_INSTANCES = 10_000
"""A choice. Each instance is a draw call in every pass."""

MAX_PLACED_VERTICES = 1 << 27
"""A choice: vertices of all instances, a mesh's once for each. Bounding that many takes 0.5 s."""

MAX_CAMERAS = 10_000
"""A choice. Each takes about 30 µs to place."""

MAX_LIGHTS = 10_000
"""A choice. Each takes about 50 µs to place."""

MAX_MORPH_BYTES = 1 << 29
"""A choice: displacements of morph targets, as floats. Many targets may share the bytes of one accessor."""

DRACO_SECONDS = 1
"""A choice: processor time that decoding a Draco bitstream may take whatever its length."""

DRACO_BYTES_PER_SECOND = 1 << 18
"""A choice: further time for its length. Measured: 22 MB/s; a slow machine has a factor of eighty."""

KTX2_SECONDS = 1
"""A choice: processor time that decoding a KTX2 image may take whatever its size."""

KTX2_TEXELS_PER_SECOND = 1 << 22
"""A choice: further time for its texels. Measured: 90 million/s; a slow machine has a factor of twenty."""

VERTEX_CHUNK = 1 << 18
"""A choice: vertices skinned at a time. It keeps the matrices of a large mesh below about 100 MiB."""

MAX_CHANNELS = 10_000
"""A choice: animation channels, which take about 50 µs each to read."""

MAX_IMAGE_BYTES = 1 << 27
"""A choice: one image file. It is copied for decoding, beside the file that it is in."""

MAX_IMAGE_SIDE = 16384
"""Side of an image in texels. Every OpenGL 4.3 driver supports at least this (GL_MAX_TEXTURE_SIZE)."""

MAX_IMAGE_TEXELS = 1 << 26
"""A choice: texels of one image. A texel takes 3 bytes, or 7 during decoding."""

MAX_SCENE_TEXELS = 3 << 26
"""A choice: texels of all images of a scene."""

FREE_TEXELS = 1 << 26
"""A choice: texels that the images of a scene may have whatever the size of their files."""

TEXELS_PER_BYTE = 64
"""A choice: further texels that they may have for each byte of image files.

A photograph has 2 to 10 texels per byte. A file that unpacks a kilobyte to a megabyte has hundreds.
"""

LARGEST_NUMBER = 1e30
"""A choice: largest number in any file. It fits float32, and the product of two fits double precision."""

LARGEST_COORDINATE = 1e12
"""In world units. A choice: kilometres in millimetres, with six digits to spare."""

LARGEST_NORMAL = 3.4e38
"""Largest component of a normal before it is scaled to unit length: any that float32 can hold."""

LARGEST_UV = 1e9
"""Largest texture coordinate. A choice: beyond 1e7, float32 cannot tell texels apart."""

SMALLEST_EXTENT = 1e-12
"""Smallest diagonal of a scene in world units. A choice, like the largest coordinate."""

SMALLEST_RANGE = 1.0 / LARGEST_NUMBER
"""Smallest range of a light in world units. A choice: at whatever scale it is drawn, it stays above 0."""

ENDLESS_RANGE = 1e18
"""In world units. A choice: within `LARGEST_COORDINATE`, such a range takes less than rounding does."""

LARGEST_RADIOMETRIC = 1e18
"""A choice: largest intensity of a light as it is drawn (`working_scale`), W/sr or W/m². Times any albedo and
area it is finite in float32."""


class DecodedBytes:
    """A budget of bytes while one scene is read.

    Args:
        most: bytes at the start; the default is for the arrays of all geometry.
        what: what takes them, for the message.
    """

    def __init__(self, most: int = MAX_DECODED_BYTES, what: str = "geometry") -> None:
        self._most = self._left = most
        self._what = what

    def require(self, count: int, where: str) -> None:
        """Check that `count` bytes are left, and take none.

        Args:
            count: bytes.
            where: the place in the file, for the message.

        Raises:
            SceneFileError: fewer bytes are left.
        """
        if count > self._left:
            raise SceneFileError(
                f"{where}: {self._what} must take at most {self._most >> 20} MiB once decoded, and this "
                f"needs {mebibytes(count)} with {self._left >> 20} MiB left"
            )

    def spend(self, count: int, where: str) -> None:
        """Take `count` bytes from the budget; like `require`."""
        self.require(count, where)
        self._left -= count
