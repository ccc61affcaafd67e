"""The artist parameters as a GLSL block and its bytes, both made from the one table.

Every field is one 4-byte number: a float, or an int where the parameter is a whole number. Scalars stand
four bytes apart in std140 and in std430 alike (OpenGL 4.6 core, 7.6.2.2), so both agree in every offset.
They differ only in what follows the last field: std140 rounds a block up to 16 bytes. The bytes made here are
so rounded, and serve a uniform buffer and a shader storage buffer.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters

BlockStorage = Literal["uniform", "buffer"]
"""A uniform block in std140, or a shader storage block in std430."""

BLOCK_NAME = "ArtistParameters"
_BLOCK_ALIGNMENT = 16
"""Bytes that std140 rounds a block's size up to (OpenGL 4.6 core, 7.6.2.2, rule 9)."""


@dataclass(frozen=True)
class BlockField:
    """One member of the block."""

    name: str
    """As in the table."""
    glsl_type: Literal["float", "int"]
    offset: int
    """From the start of the block [bytes]."""
    unit: str


BLOCK_FIELDS: tuple[BlockField, ...] = tuple(
    BlockField(spec.name, "int" if spec.whole_number else "float", 4 * index, spec.unit)
    for index, spec in enumerate(ARTIST_PARAMETERS)
)
"""In the table's order."""

BLOCK_MEMBERS = " ".join(f"{field.glsl_type} {field.name};" for field in BLOCK_FIELDS)
"""Their declarations, on one line."""

BLOCK_BYTES = -(-4 * len(BLOCK_FIELDS) // _BLOCK_ALIGNMENT) * _BLOCK_ALIGNMENT
"""Size of the block with std140's padding."""

# Little-endian whatever the machine, since the bytes are also a file that others read.
_BLOCK_DTYPE = np.dtype(
    {
        "names": [field.name for field in BLOCK_FIELDS],
        "formats": ["<i4" if field.glsl_type == "int" else "<f4" for field in BLOCK_FIELDS],
        "offsets": [field.offset for field in BLOCK_FIELDS],
        "itemsize": BLOCK_BYTES,
    }
)


def pack_parameters(parameters: ArtistParameters) -> bytes:
    """The block's `BLOCK_BYTES` bytes, little-endian, padding zero; values rounded to float32.

    Raises:
        InputError: a value is out of range.
    """
    return parameter_bytes(ArtistParameters.validated(parameters.as_dict()))


def parameter_bytes(parameters: ArtistParameters) -> bytes:
    """As `pack_parameters`, of any values: the runtime may draw with what no file may hold."""
    # Zeros first: numpy leaves the padding of a record as it finds it.
    block = np.zeros(1, _BLOCK_DTYPE)
    for name, value in parameters.as_dict().items():
        block[name] = value
    return block.tobytes()


def unpack_parameters(content: bytes) -> ArtistParameters:
    """The parameters that `BLOCK_BYTES` bytes hold.

    A bound that float32 rounded outwards counts as the bound itself.

    Raises:
        InputError: a value is not finite and in range.
        ValueError: there are more or fewer bytes than a block has.
    """
    if len(content) != BLOCK_BYTES:
        raise ValueError(f"content: a parameter block has {BLOCK_BYTES} bytes, got {len(content)}")
    block = np.frombuffer(content, _BLOCK_DTYPE)[0]
    values: dict[str, float | int] = {}
    for spec in ARTIST_PARAMETERS:
        value = block[spec.name].item()
        for bound in (spec.low, spec.high):
            if value == float(np.float32(bound)):
                value = bound
        values[spec.name] = value
    return ArtistParameters.validated(values, "parameter block")


def glsl_block(storage: BlockStorage, binding: int | str, *, access: str = "") -> str:
    """The block's declaration, members by their plain names; ASCII, GLSL 4.20 (uniform) or 4.30 (buffer).

    `binding` is a number or the name of a macro; `access` a memory qualifier such as "readonly".
    """
    layout = "std140" if storage == "uniform" else "std430"
    qualifiers = f"{access} {storage}".strip()
    members = [f"    {field.glsl_type} {field.name};  // {field.unit}" for field in BLOCK_FIELDS]
    head = f"layout({layout}, binding = {binding}) {qualifiers} {BLOCK_NAME} {{"
    return "\n".join([head, *members, "};"]) + "\n"
