"""Cases of environment maps: small .exr and .hdr images, of which some bytes are changed."""

import random
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import OpenEXR

from tests.fuzzing.byte_mutations import mutate_bytes


def hdr_image(rng: random.Random) -> bytes:
    """A Radiance image of 8 × 16 pixels, flat or with run lengths."""
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 8 +X 16\n"
    if rng.random() < 0.4:
        return head + bytes((128, 64, 200, 129)) * 8 * 16
    # A run of ten, then six bytes as they are, for each of four components.
    row = bytes((2, 2, 0, 16)) + bytes((138, 128, 6, 10, 20, 130, 140, 150, 160)) * 4
    return head + row * 8


def write_environment_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the image."""
    if rng.random() < 0.6:
        path, content = folder / "sky.hdr", hdr_image(rng)
    else:
        path, content = folder / "sky.exr", rng.choice(_exr_images())
    path.write_bytes(mutate_bytes(content, rng) if mutated else content)
    return path


@cache
def _exr_images() -> tuple[bytes, ...]:
    pixels = np.random.default_rng(4).uniform(0.0, 5.0, (8, 16, 3))
    images = []
    for dtype, compression in ((np.float16, OpenEXR.ZIP_COMPRESSION), (np.float32, OpenEXR.NO_COMPRESSION)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "sky.exr"
            OpenEXR.File({"compression": compression}, {"RGB": pixels.astype(dtype)}).write(str(path))
            images.append(path.read_bytes())
    return tuple(images)
