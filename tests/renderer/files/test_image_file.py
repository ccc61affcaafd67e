"""Image files: what is written reads back with the same orientation and bits."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.image_file import read_exr, require_extension, write_exr, write_png


def test_png_of_bytes_reads_back_the_same(tmp_path):
    image = np.random.default_rng(1).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", image)
    with Image.open(tmp_path / "a.png") as read:
        assert (read.mode, read.size) == ("RGB", (7, 5))
        np.testing.assert_array_equal(np.asarray(read), image)


def test_png_of_floats_rounds_to_nearest_and_clamps(tmp_path):
    row = np.array([-1.0, 0.0, 0.49 / 255, 0.51 / 255, 1.0, np.inf])
    write_png(tmp_path / "a.png", np.repeat(row[None, :, None], 3, axis=2))
    with Image.open(tmp_path / "a.png") as image:
        assert np.asarray(image)[0, :, 0].tolist() == [0, 0, 0, 1, 255, 255]


@pytest.mark.parametrize("shape", [(4, 6, 3), (4, 6)])
def test_exr_keeps_every_bit(tmp_path, shape):
    pixels = np.random.default_rng(2).lognormal(0.0, 8.0, shape).astype(np.float32)
    pixels[0, 0], pixels[0, 1], pixels[1, 0] = np.nan, np.inf, -1e-40
    write_exr(tmp_path / "a.exr", pixels)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr"), pixels)


def test_exr_of_one_channel_is_named_as_asked(tmp_path):
    for name in ("Y", "Z"):
        write_exr(tmp_path / "a.exr", np.ones((2, 3), np.float32), name)
        with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
            assert list(file.channels()) == [name]
            assert file.channels()[name].pixels.dtype == np.float32


def test_exr_with_alpha_gives_its_colours(tmp_path):
    pixels = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    with OpenEXR.File({}, {"RGBA": pixels}) as file:
        file.write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr"), pixels[..., :3])


def test_extensions_are_asked_for_in_any_case():
    assert require_extension(Path("A.EXR"), ".png", ".exr") == ".exr"
    with pytest.raises(InputError, match=r"a.jpg: the file name must end in .png or .exr, got '.jpg'"):
        require_extension(Path("a.jpg"), ".png", ".exr")


def test_refusals_leave_nothing_behind(tmp_path):
    image = np.zeros((2, 2, 3), np.float32)
    with pytest.raises(InputError, match=r"must end in .png, got '.exr'"):
        write_png(tmp_path / "a.exr", image)
    with pytest.raises(InputError, match=r"must end in .exr, got '.png'"):
        write_exr(tmp_path / "a.png", image)
    with pytest.raises(InputError, match="must not hold NaN"):
        write_png(tmp_path / "a.png", image * np.nan)
    assert not list(tmp_path.iterdir())


def test_files_that_are_no_exr_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"absent.exr: cannot be read \(no such file\)"):
        read_exr(tmp_path / "absent.exr")
    (tmp_path / "text.exr").write_text("not an image")
    with pytest.raises(InputError, match="text.exr: not a readable EXR file"):
        read_exr(tmp_path / "text.exr")
    with OpenEXR.File({}, {"A": np.ones((1, 1), np.float32), "B": np.ones((1, 1), np.float32)}) as file:
        file.write(str(tmp_path / "two.exr"))
    with pytest.raises(InputError, match="must hold channels R, G, B or a single one, got A, B"):
        read_exr(tmp_path / "two.exr")
