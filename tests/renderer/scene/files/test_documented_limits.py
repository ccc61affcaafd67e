"""The table of limits in docs/file_formats.md says what the readers enforce."""

from pathlib import Path

import numpy as np
import pytest
from reading_cost import CPU_S, CPU_S_PER_BYTE, MEMORY_BYTES

from vpltune.renderer.scene.files import limits, mtl_materials, ply_data, read_scene
from vpltune.renderer.scene.mitsuba_import import plugin_tree, searched_folder, xml_tree

REPOSITORY = Path(__file__).resolve().parents[4]
MIB = 1 << 20

ROWS = {
    "size": (
        f"{limits.LARGEST_COORDINATE:.0e} units of the origin, at least {limits.SMALLEST_EXTENT:.0e} across"
    ),
    "files": (
        f"{limits.MAX_FILE_BYTES // MIB} MiB together; JSON text {limits.MAX_JSON_BYTES // MIB} MiB, "
        f"{limits.MAX_JSON_VALUES:,} values; a PLY header {ply_data.LONGEST_HEADER // 1024} KiB"
    ),
    "images": (
        f"{limits.MAX_IMAGE_BYTES // MIB} MiB, {limits.MAX_IMAGE_SIDE:,} texels on a side, "
        f"{limits.MAX_IMAGE_TEXELS:,} texels; those of a scene {limits.MAX_SCENE_TEXELS:,} texels together, "
        f"and {limits.FREE_TEXELS:,} with {limits.TEXELS_PER_BYTE} for each byte"
    ),
    "geometry": f"{limits.MAX_DECODED_BYTES // MIB} MiB once decoded",
    "placed": f"{limits.MAX_PLACED_VERTICES:,} vertices",
    "glTF nodes": (
        f"{limits.MAX_NODES:,}, that place at most {limits.MAX_INSTANCES:,} primitives, "
        f"{limits.MAX_CAMERAS:,} cameras and {limits.MAX_LIGHTS:,} lights"
    ),
    "glTF motion": (
        f"{limits.MAX_CHANNELS:,} animation channels; morph targets {limits.MAX_MORPH_BYTES // MIB} MiB"
    ),
    "OBJ": f"{mtl_materials.MOST_LIBRARIES:,} names of libraries",
    "MTL": f"{mtl_materials._MOST_DEFINITIONS:,} materials",
    "Mitsuba": (
        f"{xml_tree._MOST_NODES:,} elements, {limits.MAX_INSTANCES:,} shapes and {limits.MAX_INSTANCES:,} "
        f"placed, {plugin_tree._LONGEST_VALUE:,} characters of an attribute with its defaults, "
        f"{searched_folder.MOST_PATHS} search paths"
    ),
    "intensity of a light": f"{limits.LARGEST_RADIOMETRIC:.0e} W/sr".replace("+", ""),
    "cost": (
        f"{MEMORY_BYTES >> 30} GiB of memory; {CPU_S:g} s of processor time, "
        f"and {1e6 * CPU_S_PER_BYTE:g} µs for each byte"
    ),
}


def row(name):
    text = (REPOSITORY / "docs" / "file_formats.md").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {name} |"))
    return line


@pytest.mark.parametrize("name", ROWS)
def test_the_table_has_the_limit(name):
    assert ROWS[name].replace("e+", "e") in row(name)


def test_the_table_has_the_triangles_of_gltf(gltf, monkeypatch):
    """What a flat triangle takes of the budget, over a thousand of them, as a mesh takes some at once."""
    spent = []
    spend = limits.DecodedBytes.spend
    monkeypatch.setattr(
        limits.DecodedBytes,
        "spend",
        lambda self, count, where: spent.append(count) or spend(self, count, where),
    )
    gltf.add_primitive(np.random.default_rng(1).random((3000, 3)).astype(np.float32))
    assert read_scene(gltf.write()).triangle_count() == 1000
    assert f"{limits.MAX_DECODED_BYTES / (sum(spent) / 1000) / 1e6:.2f} million flat" in row("geometry")
