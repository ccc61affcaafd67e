"""Radiance .hdr images: flat and run-length scanlines, the header, and files that lie."""

import re
import time

import numpy as np
import pytest

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.radiance_hdr import MOST_PIXELS, hdr_pixels


def encoded(pixels):
    """RGBE bytes [height, width, 4] of radiances, as Ward 1991 has them."""
    mantissa, exponent = np.frexp(pixels.max(axis=2))
    scale = np.where(pixels.max(axis=2) > 0.0, np.ldexp(256.0, -exponent), 0.0)
    rgbe = np.empty((*pixels.shape[:2], 4), np.uint8)
    rgbe[..., :3] = pixels * scale[..., None]
    rgbe[..., 3] = np.where(mantissa > 0.0, exponent + 128, 0)
    return rgbe


def flat(rgbe, header=b""):
    height, width, _ = rgbe.shape
    size = f"-Y {height} +X {width}\n".encode()
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n" + header + b"\n" + size + rgbe.tobytes()


def packed(rgbe):
    """With run lengths, where at least three bytes are equal."""
    height, width, _ = rgbe.shape
    rows = bytearray()
    for row in rgbe:
        rows += bytes((2, 2, width >> 8, width & 255))
        for component in row.T:
            at = 0
            while at < width:
                run = 1
                while at + run < width and run < 127 and component[at + run] == component[at]:
                    run += 1
                if run > 2:
                    rows += bytes((128 + run, component[at]))
                    at += run
                    continue
                end = at + 1
                while (
                    end < width and end - at < 128 and not (component[end : end + 3] == component[end]).all()
                ):
                    end += 1
                rows += bytes((end - at,)) + component[at:end].tobytes()
                at = end
    return b"#?RGBE\n\n" + f"-Y {height} +X {width}\n".encode() + bytes(rows)


def picture(height=5, width=40):
    pixels = np.random.default_rng(1).uniform(0.0, 900.0, (height, width, 3))
    pixels[2, 3:35] = 7.0
    pixels[4, 0] = 0.0
    pixels[0, 0] = (1e-6, 0.0, 1e-7)
    return pixels


@pytest.mark.parametrize("form", [flat, packed])
def test_pixels_come_back_within_a_step_of_the_mantissa(form):
    pixels = picture()
    read = hdr_pixels(form(encoded(pixels)), "a.hdr")
    assert read.dtype == np.float32
    assert (np.abs(read - pixels) <= pixels.max(axis=2, keepdims=True) / 128.0).all()
    assert not read[4, 0].any()


def test_known_bytes():
    rgbe = np.array([[[128, 64, 0, 129], [255, 1, 2, 0]]], np.uint8)
    np.testing.assert_array_equal(hdr_pixels(flat(rgbe), ""), [[[1.0, 0.5, 0.0], [0.0, 0.0, 0.0]]])


@pytest.mark.parametrize("form", [flat, packed])
def test_bytes_after_the_last_row_change_nothing(form):
    content = form(encoded(picture()))
    np.testing.assert_array_equal(hdr_pixels(content + b"\1\2\3\4", ""), hdr_pixels(content, ""))


def test_exposures_are_divided_out():
    rgbe = np.array([[[128, 128, 128, 129]]], np.uint8)
    exposed = flat(rgbe, b"EXPOSURE=4\nEXPOSURE= 0.5\n")
    np.testing.assert_array_equal(hdr_pixels(exposed, ""), [[[0.5, 0.5, 0.5]]])


SIZE = b"-Y 5 +X 40"
BROKEN = {
    "empty": (lambda content: b"", "is not a Radiance"),
    "other": (lambda content: b"\x89PNG\n\n", "is not a Radiance"),
    "xyz": (lambda content: content.replace(b"rle_rgbe", b"rle_xyze"), "FORMAT must be"),
    "exposure": (lambda content: content.replace(b"\n\n", b"\nEXPOSURE=nan\n\n", 1), "EXPOSURE must be"),
    "exposed": (lambda content: content.replace(b"\n\n", b"\nEXPOSURE=1e-30\n\n", 1), "EXPOSURE must be"),
    "upside down": (lambda content: content.replace(SIZE, b"+Y 5 +X 40"), "must have a line like"),
    "no rows": (
        lambda content: content.replace(SIZE, b"-Y 0 +X 40"),
        "must have at least one pixel, got 40 × 0",
    ),
    "no columns": (lambda content: content.replace(SIZE, b"-Y 5 +X 0"), "must have at least one pixel"),
    "wide": (lambda content: content.replace(SIZE, b"-Y 1 +X 16385"), "must be at most"),
    "bomb": (lambda content: content.replace(SIZE, b"-Y 16000 +X 16000"), f"{MOST_PIXELS:,} in all"),
    "tall": (lambda content: content.replace(SIZE, b"-Y 2000 +X 4000"), "is cut short"),
    "cut": (lambda content: content[:-1], "is cut short|has more pixels"),
}


@pytest.mark.parametrize("form", [flat, packed])
@pytest.mark.parametrize("case", BROKEN.keys())
def test_files_that_lie_are_refused(form, case):
    change, said = BROKEN[case]
    content = change(form(encoded(picture())))
    if case == "xyz" and form is packed:
        pytest.skip("it has no FORMAT")
    with pytest.raises(SceneFileError, match=rf"^a\.hdr: .*({said})"):
        hdr_pixels(content, "a.hdr")


def test_old_runs_are_refused():
    rgbe = np.array([[[128, 128, 128, 129], [1, 1, 1, 30]]], np.uint8)
    with pytest.raises(SceneFileError, match="repeats whole pixels"):
        hdr_pixels(flat(rgbe), "a.hdr")


def test_changed_bytes_are_read_or_refused():
    content = bytearray(packed(encoded(picture())))
    random = np.random.default_rng(9)
    for _ in range(300):
        changed = bytearray(content)
        for at in random.integers(0, len(content), 3):
            changed[at] = random.integers(256)
        try:
            assert hdr_pixels(bytes(changed), "a.hdr").ndim == 3
        except SceneFileError as error:
            assert re.match(r"a\.hdr: ", str(error))


def test_short_runs_take_no_longer_than_they_may():
    """One byte for each code, four codes where one would do."""
    width = 4096
    row = bytes((2, 2, width >> 8, width & 255)) + bytes((1, 7)) * (4 * width)
    content = b"#?RADIANCE\n\n-Y 2048 +X 4096\n" + row * 2048
    begin = time.process_time()
    with pytest.raises(SceneFileError, match="in its run lengths"):
        hdr_pixels(content, "a.hdr")
    assert time.process_time() - begin < 1.0
