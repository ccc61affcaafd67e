"""EXT_meshopt_compression: streams encoded here according to the specification decode byte for byte."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.meshopt_attributes import decode_attributes
from vpltune.renderer.scene.files.meshopt_filters import unfiltered
from vpltune.renderer.scene.files.meshopt_indices import decode_indices, decode_triangles


def packed_group(zigzag: np.ndarray, mode: int) -> bytes:
    """Encode a group of 16 differences. Mode 0 can hold zeros only, modes 1 to 3 any differences."""
    if mode == 0:
        return b""
    if mode == 3:
        return zigzag.tobytes()
    bits = 2 * mode
    full = (1 << bits) - 1
    short = [min(int(value), full) for value in zigzag]
    per_byte = 8 // bits
    packed = bytes(
        sum(short[start + k] << (8 - bits * (k + 1)) for k in range(per_byte))
        for start in range(0, 16, per_byte)
    )
    return packed + bytes(int(value) for value in zigzag if value >= full)


def encoded_attributes(elements: np.ndarray, modes: np.random.Generator) -> bytes:
    """Encode elements [count, stride]. The mode of each group is drawn from those that can hold it."""
    count, stride = elements.shape
    baseline = modes.integers(0, 256, stride, dtype=np.uint8)
    before = np.vstack([baseline, elements[:-1]])
    signed = (elements - before).astype(np.int8).astype(np.int16)
    zigzag = np.where(signed < 0, -2 * signed - 1, 2 * signed).astype(np.uint8)
    largest = min(8192 // stride & ~15, 256)
    stream = bytearray([0xA0])
    for first in range(0, count, largest):
        block = zigzag[first : first + largest]
        groups = -(-len(block) // 16)
        padded = np.zeros((groups * 16, stride), np.uint8)
        padded[: len(block)] = block
        for column in padded.T:
            chosen = [int(modes.integers(0 if not group.any() else 1, 4)) for group in column.reshape(-1, 16)]
            header = bytearray(-(-groups // 4))
            for group, mode in enumerate(chosen):
                header[group // 4] |= mode << 2 * (group % 4)
            stream += header
            for group, mode in zip(column.reshape(-1, 16), chosen, strict=True):
                stream += packed_group(group, mode)
    return bytes(stream) + bytes(max(32 - stride, 0)) + baseline.tobytes()


def varint(value: int) -> bytes:
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def zigzag_of(difference: int) -> int:
    return 2 * difference if difference >= 0 else -2 * difference - 1


def told_triangles(indices: list[int]) -> bytes:
    """Encode a triangle list with every index as a difference: code 0xff, all choices 15."""
    data, last = bytearray(), 0
    for start in range(0, len(indices), 3):
        data.append(0xFF)
        for index in indices[start : start + 3]:
            data += varint(zigzag_of(index - last))
            last = index
    codes = bytes([0xFF]) * (len(indices) // 3)
    return bytes([0xE1]) + codes + bytes(data) + bytes(16)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 700), st.sampled_from([4, 8, 12, 64, 256]), st.integers(0, 2**31), st.integers(1, 256))
def test_attributes_come_back(count, stride, seed, spread):
    """Any bytes decode, in groups of every mode, in partial groups and blocks, and with wrap-around."""
    random = np.random.default_rng(seed)
    steps = random.integers(-spread // 2, spread // 2 + 1, (count, stride)) * random.integers(
        0, 2, (count, 1)
    )
    elements = np.cumsum(steps, axis=0).astype(np.uint8)
    stream = encoded_attributes(elements, random)
    np.testing.assert_array_equal(decode_attributes(stream, count, stride, "here"), elements)
    for length in (0, 1, 20, len(stream) - 33):
        if length < len(stream) - max(stride, 32):
            with pytest.raises(SceneFileError, match="here: "):
                decode_attributes(stream[: length + 1] + stream[-max(stride, 32) :], count, 256, "here")


def test_the_specification_s_example():
    """The specification's group of 16 differences of 4 bits, two of them as full bytes, with its values."""
    group = bytes.fromhex("175ff0bc77a9210034b5")
    expected = np.cumsum([-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]).astype(np.uint8)
    stream = bytes([0xA0, 2]) + group + bytes(3) + bytes(32)
    elements = decode_attributes(stream, 16, 4, "here")
    np.testing.assert_array_equal(elements[:, 0], expected)
    assert not elements[:, 1:].any()


@given(st.lists(st.integers(0, 2**31 - 1), min_size=3, max_size=60))
def test_told_indices_come_back(indices):
    indices = indices[: len(indices) // 3 * 3]
    np.testing.assert_array_equal(
        decode_triangles(told_triangles(indices), len(indices), "here"), np.array(indices, np.uint32)
    )
    deltas = np.diff([0, *[index % 2**29 for index in indices]])
    stream = b"".join(varint(zigzag_of(int(delta)) << 1) for delta in deltas)
    decoded = decode_indices(bytes([0xD1]) + stream + bytes(4), len(indices), "here")
    np.testing.assert_array_equal(decoded, np.array(indices, np.uint32) % 2**29)


def test_a_strip_by_its_edges():
    """New vertices on the newest edge, a recent vertex, one next to the last coded one, and a reset."""
    table = bytes([0x00]) + bytes(15)
    codes = bytes([0xF0, 0x00, 0x10, 0x03, 0x0F, 0x0E, 0xFE])
    data = varint(zigzag_of(9)) + bytes([0x00])
    stream = bytes([0xE1]) + codes + data + table
    # Edges, newest first, after (0, 1, 2): (0, 2), (2, 1), (1, 0). One more on (a, b) leaves (a, c), (c, b).
    expected = [(0, 1, 2), (0, 2, 3), (3, 2, 4), (3, 4, 1), (3, 1, 9), (3, 9, 10), (0, 1, 2)]
    np.testing.assert_array_equal(decode_triangles(stream, 21, "here").reshape(-1, 3), expected)
    with pytest.raises(SceneFileError, match="must end after its last triangle"):
        decode_triangles(stream[:10] + b"\0" + stream[10:], 21, "here")


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200), st.integers(1, 40))
def test_noise_is_refused_or_decoded_but_never_crashes(noise, count):
    for header, decode in (
        (0xE1, lambda stream: decode_triangles(stream, 3 * count, "here")),
        (0xD1, lambda stream: decode_indices(stream, count, "here")),
        (0xA0, lambda stream: decode_attributes(stream, count, 8, "here")),
    ):
        try:
            decode(bytes([header]) + noise)
        except SceneFileError as error:
            assert str(error).startswith("here: ")


@pytest.mark.parametrize(("dtype", "bits"), [("i1", 6), ("i1", 8), ("<i2", 10), ("<i2", 16)])
def test_octahedral_vectors_are_the_unit_vectors_they_stand_for(dtype, bits):
    """To within the quantisation step of K bits, on both hemispheres. The fourth component is unchanged."""
    random = np.random.default_rng(1)
    vectors = random.normal(size=(200, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    flat = vectors / np.abs(vectors).sum(axis=1, keepdims=True)
    folded = (1.0 - np.abs(flat[:, [1, 0]])) * np.where(flat[:, :2] >= 0.0, 1.0, -1.0)
    encoded = np.where(flat[:, 2:] >= 0.0, flat[:, :2], folded)
    one = (1 << bits - 1) - 1
    stored = np.empty((200, 4), dtype)
    stored[:, :2] = np.rint(encoded * one)
    stored[:, 2], stored[:, 3] = one, np.arange(200) % 100
    decoded = unfiltered(stored.view(np.uint8), "OCTAHEDRAL").view(dtype)
    np.testing.assert_allclose(decoded[:, :3] / np.iinfo(dtype).max, vectors, atol=2.5 / one)
    np.testing.assert_array_equal(decoded[:, 3], stored[:, 3])


def test_quaternions_are_what_they_stand_for():
    """To within the quantisation step of 12 bits, for any position of the largest component."""
    random = np.random.default_rng(2)
    quaternions = random.normal(size=(200, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    place = np.abs(quaternions).argmax(axis=1)
    quaternions *= np.sign(np.take_along_axis(quaternions, place[:, None], axis=1))
    one = (1 << 11) - 1
    rest = np.take_along_axis(quaternions, (place[:, None] + [1, 2, 3]) % 4, axis=1)
    stored = np.empty((200, 4), "<i2")
    stored[:, :3] = np.rint(rest * np.sqrt(2.0) * one)
    stored[:, 3] = one & ~3 | place
    decoded = unfiltered(stored.view(np.uint8), "QUATERNION").view("<i2") / 32767.0
    np.testing.assert_allclose(decoded, quaternions, atol=2.0 / one)


def test_exponential_floats():
    pairs = [(0, 1), (3, -5), (-20, 8_388_607), (100, -8_388_608), (-100, 1)]
    stored = np.array([(e << 24) | (m & 0xFFFFFF) for e, m in pairs], np.int64).astype("<u4").reshape(-1, 1)
    decoded = unfiltered(stored.view(np.uint8), "EXPONENTIAL").view("<f4")[:, 0]
    np.testing.assert_array_equal(decoded, np.array([m * 2.0**e for e, m in pairs], "<f4"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mode": "POINTS"}, r"mode: must be one of ATTRIBUTES, TRIANGLES, INDICES, got 'POINTS'"),
        ({"filter": "WAVELET"}, r"filter: is not allowed with mode ATTRIBUTES, got 'WAVELET'"),
        ({"byteStride": 10}, r"byteStride: is not allowed with mode ATTRIBUTES and filter NONE, got 10"),
        ({"count": 4}, r"byteLength: must be count times byteStride, 48, got 36"),
        ({"byteLength": 9}, "must be an EXT_meshopt_compression stream of attributes"),
    ],
)
def test_a_triangle_stored_compressed(triangle, change, message):
    """A triangle with compressed positions is read like the uncompressed one, and errors name their key."""
    positions = bytes(triangle.blob[:36])
    stream = encoded_attributes(np.frombuffer(positions, np.uint8).reshape(3, 12), np.random.default_rng(0))
    compression = {
        "buffer": 0,
        "byteOffset": 0,
        "byteLength": len(stream),
        "byteStride": 12,
        "mode": "ATTRIBUTES",
        "count": 3,
    }
    plain = read_scene(triangle.write())
    triangle.document["bufferViews"][0] |= {
        "buffer": 1,
        "extensions": {"EXT_meshopt_compression": compression},
    }
    triangle.document["buffers"] = [{"byteLength": len(stream), "uri": "scene.bin"}, {"byteLength": 36}]
    triangle.blob = bytearray(stream)
    read = read_scene(triangle.write())
    np.testing.assert_array_equal(read.meshes[0].positions, plain.meshes[0].positions)
    compression |= change
    with pytest.raises(InputError, match=message):
        read_scene(triangle.write())


def test_one_stream_cannot_be_decoded_again_and_again(triangle):
    """A view takes 200 bytes to name, and its stream up to a thousand times as long to decode."""
    stream = encoded_attributes(
        np.frombuffer(bytes(triangle.blob[:36]), np.uint8).reshape(3, 12), np.random.default_rng(0)
    )
    compression = {"buffer": 0, "byteLength": len(stream), "byteStride": 12, "mode": "ATTRIBUTES", "count": 3}
    view = {"buffer": 1, "byteLength": 36, "extensions": {"EXT_meshopt_compression": compression}}
    triangle.document["bufferViews"] = [view, view]
    triangle.document["buffers"] = [{"byteLength": len(stream), "uri": "scene.bin"}, {"byteLength": 36}]
    triangle.primitive["attributes"]["NORMAL"] = triangle.add(
        "accessors", {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"}
    )
    triangle.blob = bytearray(stream)
    with pytest.raises(InputError, match="EXT_meshopt_compression: must not overlap other compressed views"):
        read_scene(triangle.write())
