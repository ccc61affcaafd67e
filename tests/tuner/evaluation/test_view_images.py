"""images.npz: what was drawn is read back, at any scale, within its bounds; what is broken is refused."""

import io
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from reading_cost import IMAGES, check_cost

from vpltune.renderer.errors import InputError
from vpltune.tuner.evaluation.view_images import (
    MAXIMUM_PIXELS,
    MAXIMUM_VIEWS,
    VARIANTS,
    read_view_images,
    write_view_images,
)

RANDOM = np.random.default_rng(0)


def evaluated(split="fitted", size=(6, 8), unit=1.0):
    """Stands for an `EvaluatedView` with noise for images; `unit` scales all light."""

    def image(factor=unit):
        return (factor * RANDOM.random((*size, 3))).astype(np.float32)

    reference = SimpleNamespace(albedo=image(1.0), direct_irradiance=image(), irradiance=image())
    captured = SimpleNamespace(albedo=image(1.0), direct_irradiance=image())
    view = SimpleNamespace(
        view=SimpleNamespace(split=split),
        reference=reference,
        captured=captured,
        valid=RANDOM.random(size) < 0.9,
    )
    return SimpleNamespace(view=view, irradiance={variant: image() for variant in VARIANTS})


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_images_read_back_within_a_half_floats_rounding(tmp_path, unit):
    drawn = evaluated(unit=unit)
    write_view_images(tmp_path / "images.npz", [drawn])
    (read,) = read_view_images(tmp_path / "images.npz")
    assert (read.valid == drawn.view.valid).all()
    # Eleven bits of mantissa: half a unit in the last place is 2**-11 of the value, or 2**-25 at the least.
    close = {"rtol": 2**-11, "atol": 2**-25 * read.level}
    np.testing.assert_allclose(read.level * read.indirect["tuned"], drawn.irradiance["tuned"], **close)
    np.testing.assert_allclose(
        read.level * read.indirect["reference"], drawn.view.reference.irradiance, **close
    )
    np.testing.assert_allclose(read.level * read.direct, drawn.view.captured.direct_irradiance, **close)
    np.testing.assert_allclose(read.albedo, drawn.view.captured.albedo, rtol=2**-11, atol=2**-25)


def test_a_black_view_and_one_with_a_spike_are_kept(tmp_path):
    black = evaluated(unit=0.0)
    spike = evaluated()
    spike.irradiance["default"][0, 0] = 1e9
    write_view_images(tmp_path / "images.npz", [black, spike])
    first, second = read_view_images(tmp_path / "images.npz")
    assert first.level == 1.0
    assert not first.radiance("tuned").any()
    assert second.indirect["default"][0, 0, 0] == np.finfo(np.float16).max


def test_radiance_is_albedo_over_pi_times_irradiance(tmp_path):
    write_view_images(tmp_path / "images.npz", [evaluated()])
    (read,) = read_view_images(tmp_path / "images.npz")
    expected = read.reference_albedo / np.pi * (read.reference_direct + read.indirect["reference"])
    np.testing.assert_allclose(read.radiance("reference"), expected, rtol=1e-6)
    expected = read.albedo / np.pi * (read.direct + read.indirect["ceiling"])
    np.testing.assert_allclose(read.radiance("ceiling"), expected, rtol=1e-6)


def test_the_file_is_bounded(tmp_path):
    """Large views lose pixels, not their edges; of many views the first of each split stay."""
    write_view_images(tmp_path / "large.npz", [evaluated(size=(601, 800))])
    (read,) = read_view_images(tmp_path / "large.npz")
    assert read.valid.shape == (151, 200)
    assert read.valid.size <= MAXIMUM_PIXELS
    many = [evaluated("fitted" if index < 30 else "held_out", size=(2, 2)) for index in range(45)]
    write_view_images(tmp_path / "many.npz", many)
    kept = [view.index for view in read_view_images(tmp_path / "many.npz")]
    assert kept == [*range(MAXIMUM_VIEWS["fitted"]), *range(30, 30 + MAXIMUM_VIEWS["held_out"])]


def test_no_file_is_no_images(tmp_path):
    assert read_view_images(tmp_path / "images.npz") == ()


def test_what_is_broken_is_refused_by_name(tmp_path):
    path = tmp_path / "images.npz"
    write_view_images(path, [evaluated()])
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0x55
    lone_array = io.BytesIO()
    np.save(lone_array, np.zeros(3))
    for content in (whole[: len(whole) // 2], bytes(flipped), bytes(len(whole)), lone_array.getvalue(), b""):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"images.npz: not a readable images.npz"):
            read_view_images(path)
    with np.load(io.BytesIO(whole)) as archive:
        members = {name: archive[name] for name in archive.files}
    for name, wrong, message in (
        ("0/direct", None, "member 0/direct is missing"),
        ("0/direct", np.zeros((6, 8, 3), np.float32), r"0/direct must be \(6, 8\) finite half floats"),
        ("0/direct", np.full((6, 8, 3), np.nan, np.float16), "finite half floats"),
        ("0/valid", np.ones((6, 8, 3), bool), "0/valid must be an image"),
        ("0/level", np.zeros(0, np.float32), "0/level must be one finite float32"),
        ("0/level", np.float32(np.nan), "0/level must be one finite float32"),
    ):
        changed = {key: value for key, value in {**members, name: wrong}.items() if value is not None}
        np.savez_compressed(path, **changed)
        with pytest.raises(InputError, match=message):
            read_view_images(path)


def test_members_of_other_names_are_passed_over(tmp_path):
    """Python refuses to read a number of so many digits."""
    path = tmp_path / "images.npz"
    np.savez_compressed(path, **{"9" * 5000 + "/level": np.zeros(1), "x/level": np.zeros(1)})
    assert read_view_images(path) == ()


def test_an_archive_that_unpacks_to_gigabytes_is_refused(tmp_path):
    path = tmp_path / "images.npz"
    np.savez_compressed(path, **{"0/valid": np.zeros((20_000, 60_000), bool)})
    assert path.stat().st_size < 4_000_000
    assert "its arrays must take at most 110 MiB together, and '0/valid.npy' exceeds" in check_cost(
        path, IMAGES
    )
    # A header alone can ask for as much.
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "|b1", "fortran_order": False, "shape": (1 << 40, 1 << 20)}
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("0/valid.npy", header.getvalue())
    assert "exceeds" in check_cost(path, IMAGES)
