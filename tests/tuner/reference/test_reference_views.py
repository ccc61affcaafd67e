"""References: reproducible bit for bit, independent halves, known noise, independent of scale, cached."""

import os
import pickle
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.errors import MachineError
from vpltune.renderer.files import unfinished_files
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.unfinished_files import PREFIX
from vpltune.renderer.scene.environment import even_sky
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.reference import ReferenceView, cache, noise_floor, reference_views

IMAGES = ("irradiance_a", "irradiance_b", "direct_irradiance", "albedo", "position_world", "normal_world")


def no_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path))


def same(a: ReferenceView, b: ReferenceView) -> bool:
    images = all(np.array_equal(getattr(a, name), getattr(b, name)) for name in (*IMAGES, "valid"))
    return images and a.samples == b.samples


def test_same_seed_same_bits_and_another_seed_others(shapes, monkeypatch, tmp_path):
    scene, view = shapes.box_room(), shapes.box_room_view()
    made = []
    for run, seed in enumerate((5, 5, 6)):
        no_cache(monkeypatch, tmp_path / str(run))
        made.append(
            reference_views(scene, (view,), seed=seed, noise_target=0.0, max_samples=64, bounces=1)[0]
        )
    assert same(made[0], made[1])
    assert not np.array_equal(made[0].irradiance_a, made[2].irradiance_a)
    assert np.array_equal(made[0].direct_irradiance, made[2].direct_irradiance)


def test_sampling_stops_at_the_noise_target(shapes):
    scene, view = shapes.box_room(), shapes.box_room_view()
    by_target = {
        target: reference_views(scene, (view,), noise_target=target, max_samples=2048, bounces=1)[0]
        for target in (1e-2, 1e-3)
    }
    assert by_target[1e-2].samples < by_target[1e-3].samples
    for target, got in by_target.items():
        assert noise_floor(got) <= target
    capped = reference_views(scene, (view,), noise_target=0.0, max_samples=100, bounces=1)[0]
    assert capped.samples == 100


def test_noise_floor_is_the_error_of_the_mean(shapes):
    """The relMSE against a reference with far more samples matches the prediction from the two halves."""
    scene, view = shapes.box_room(), shapes.box_room_view()
    truth = reference_views(scene, (view,), seed=1, noise_target=0.0, max_samples=4096, bounces=1)[0]
    valid = truth.valid
    scale = truth.irradiance[valid] ** 2 + 0.01 * truth.irradiance[valid].mean() ** 2
    measured, foretold = [], []
    for seed in range(2, 10):
        got = reference_views(scene, (view,), seed=seed, noise_target=0.0, max_samples=32, bounces=1)[0]
        measured.append(np.mean((got.irradiance - truth.irradiance)[valid] ** 2 / scale))
        foretold.append(noise_floor(got))
    # Means over eight seeds and 500 pixels; each scatters by some 10 %.
    assert np.mean(measured) == pytest.approx(np.mean(foretold), rel=0.25)


def test_halves_are_independent(shapes):
    """The errors of both halves are uncorrelated over pixels and seeds."""
    scene, view = shapes.box_room(), shapes.box_room_view((16, 12))
    truth = reference_views(scene, (view,), seed=1, noise_target=0.0, max_samples=4096, bounces=1)[0]
    errors = []
    for seed in range(2, 12):
        got = reference_views(scene, (view,), seed=seed, noise_target=0.0, max_samples=16, bounces=1)[0]
        errors.append(
            [(half - truth.irradiance)[truth.valid][:, 1] for half in (got.irradiance_a, got.irradiance_b)]
        )
    a, b = np.array(errors).transpose(1, 0, 2).reshape(2, -1)
    # Over 1,500 pairs of independent numbers, the correlation stays within 4/√1500.
    assert abs(np.corrcoef(a, b)[0, 1]) < 4.0 / np.sqrt(a.size)


@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0, 100.0])
def test_scale_changes_nothing(shapes, factor):
    scene, view = shapes.box_room(), shapes.box_room_view()
    base = reference_views(scene, (view,), noise_target=0.0, max_samples=64, bounces=1)[0]
    other = reference_views(
        scaled(scene, factor), (scaled_view(view, factor),), noise_target=0.0, max_samples=64, bounces=1
    )[0]
    assert np.array_equal(base.valid, other.valid)
    # The rays are the same up to rounding in the last place, which lets a sample or two miss an edge.
    for name in ("irradiance_a", "irradiance_b", "direct_irradiance"):
        error = np.abs(getattr(other, name) - getattr(base, name)) / (base.irradiance.mean())
        assert np.mean(error) < 1e-4, name
    np.testing.assert_allclose(other.position_world, base.position_world * factor, atol=1e-5 * factor)


def test_kept_references_are_found_without_mitsuba(shapes, monkeypatch, tmp_path):
    no_cache(monkeypatch, tmp_path)
    scene, view = shapes.box_room(), shapes.box_room_view((8, 6))
    arguments = {"noise_target": 0.0, "max_samples": 16}
    made = reference_views(scene, (view,), **arguments)[0]
    monkeypatch.setattr("vpltune.tuner.reference.references._rendered", None)
    assert same(made, reference_views(scene, (view,), **arguments)[0])
    # A glowing one keeps its emission too, and a dark one has none.
    lit = replace(scene, environment=even_sky((1.0, 1.0, 1.0)))
    monkeypatch.undo()
    no_cache(monkeypatch, tmp_path)
    bright = reference_views(lit, (view,), **arguments)[0]
    monkeypatch.setattr("vpltune.tuner.reference.references._rendered", None)
    kept = reference_views(lit, (view,), **arguments)[0]
    assert same(bright, kept) and np.array_equal(bright.emission, kept.emission)
    assert kept.direct_noise_floor == bright.direct_noise_floor > made.direct_noise_floor == 0.0
    assert made.emission is None
    # Names do not enter the key.
    renamed = replace(scene, name="another name")
    assert same(made, reference_views(renamed, (replace(view, name="other"),), **arguments)[0])


def test_anything_that_matters_makes_another_reference(shapes, monkeypatch, tmp_path):
    no_cache(monkeypatch, tmp_path)
    scene, view = shapes.box_room(), shapes.box_room_view((8, 6))
    made = []

    def counted(scene, view, *rest):
        made.append(view)
        return ReferenceView(
            **{name: np.zeros((6, 8, 3), np.float32) for name in IMAGES}
            | {"position_world": np.zeros((6, 8, 3)), "valid": np.zeros((6, 8), bool), "samples": 1}
        )

    monkeypatch.setattr("vpltune.tuner.reference.references._rendered", counted)
    mesh = scene.meshes[0]
    moved = mesh.positions.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], np.float32(9.0))
    brighter = replace(view.lights[0], intensity=view.lights[0].intensity * 2.0)
    plain = {"seed": 0, "noise_target": 0.1, "max_samples": 4, "bounces": 1}
    glow = replace(scene.materials[0], emission=(1.0, 0.0, 0.0))

    def glowing(**changes):
        return replace(scene, materials=(replace(glow, **changes), *scene.materials[1:]))

    variations = [
        (scene, view, {}),
        (replace(scene, meshes=(replace(mesh, positions=moved), *scene.meshes[1:])), view, {}),
        (replace(scene, materials=(shapes.gray(0.1), *scene.materials[1:])), view, {}),
        (replace(scene, instances=scene.instances[:-1]), view, {}),
        (scene, replace(view, lights=(brighter, *view.lights[1:])), {}),
        (scene, replace(view, camera=replace(view.camera, yfov=0.5)), {}),
        (scene, view, {"seed": 1}),
        (scene, view, {"noise_target": 0.2}),
        (scene, view, {"max_samples": 8}),
        (scene, view, {"bounces": None}),
        (glowing(), view, {}),
        (glowing(emission=(1.0, 0.0, 0.1)), view, {}),
        (glowing(emission_texture=0), view, {}),
        (glowing(emits_both_ways=True), view, {}),
        (replace(scene, environment=even_sky((1.0, 1.0, 1.0))), view, {}),
        (replace(scene, environment=even_sky((1.0, 1.0, 2.0))), view, {}),
    ]
    for _ in range(2):
        for changed_scene, changed_view, changes in variations:
            reference_views(changed_scene, (changed_view,), **plain | changes)
    assert len(made) == len(variations)


@pytest.mark.parametrize("damage", ["truncated", "flipped", "zeroed", "empty", "swapped"])
def test_damaged_entries_are_made_again(shapes, monkeypatch, tmp_path, damage, caplog):
    no_cache(monkeypatch, tmp_path)
    scene, view = shapes.box_room(), shapes.box_room_view((8, 6))
    arguments = {"noise_target": 0.0, "max_samples": 16}
    made = reference_views(scene, (view,), **arguments)[0]
    (entry,) = (tmp_path / "references").iterdir()
    data = bytearray(entry.read_bytes())
    if damage == "flipped":
        data[len(data) // 2] ^= 1
    others = {"truncated": data[: len(data) // 2], "flipped": data, "zeroed": bytes(len(data)), "empty": b""}
    # "swapped" replaces the entry by a valid one of another reference.
    reference_views(scene, (view,), **arguments | {"seed": 1})
    (other,) = set((tmp_path / "references").iterdir()) - {entry}
    entry.write_bytes(others.get(damage, other.read_bytes()))
    assert same(made, reference_views(scene, (view,), **arguments)[0])
    assert "damaged" in caplog.text
    caplog.clear()
    assert same(made, reference_views(scene, (view,), **arguments)[0])
    assert not caplog.text


def test_a_folder_that_cannot_be_written_is_no_error(shapes, monkeypatch, tmp_path, caplog):
    (tmp_path / "file").write_text("in the way")
    no_cache(monkeypatch, tmp_path / "file")
    scene, view = shapes.box_room(), shapes.box_room_view((8, 6))
    assert reference_views(scene, (view,), noise_target=0.0, max_samples=16, bounces=1)[0].samples == 16
    assert "not cached" in caplog.text


def test_old_entries_go_when_the_cache_is_full(shapes, monkeypatch, tmp_path):
    no_cache(monkeypatch, tmp_path)
    scene = shapes.box_room()
    views = [shapes.box_room_view((8, 6 + k)) for k in range(3)]
    for view in views:
        reference_views(scene, (view,), noise_target=0.0, max_samples=1, bounces=1)
    sizes = [path.stat().st_size for path in (tmp_path / "references").iterdir()]
    monkeypatch.setattr(cache, "SIZE_LIMIT", max(sizes) * 2)
    reference_views(scene, (shapes.box_room_view((8, 5)),), noise_target=0.0, max_samples=1, bounces=1)
    assert len(list((tmp_path / "references").iterdir())) <= 2


def test_progress_rises_to_one_and_an_interrupt_leaves_nothing(shapes, monkeypatch, tmp_path):
    no_cache(monkeypatch, tmp_path)
    scene = shapes.box_room()
    views = tuple(shapes.box_room_view((8, 6 + k)) for k in range(2))
    seen = []
    arguments = {"noise_target": 0.0, "max_samples": 200}

    def interrupted(name, share):
        if share > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reference_views(scene, views, progress=interrupted, **arguments)
    assert list((tmp_path / "references").iterdir()) == []
    reference_views(scene, views, progress=lambda name, share: seen.append(share), **arguments)
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)


@pytest.mark.parametrize("bad", [{"max_samples": 0}, {"bounces": 0}, {"noise_target": -1.0}, {"seed": -1}])
def test_arguments_out_of_range_are_refused(shapes, bad):
    with pytest.raises(ValueError, match="must be at least"):
        reference_views(shapes.box_room(), (shapes.box_room_view((8, 6)),), **bad)


@pytest.mark.parametrize("change", ["none", "glows", "lights end"])
def test_scalar_fallback_agrees_within_noise(shapes, tmp_path, change):
    """Without LLVM, the same rays with the same randomisation are traced: results agree far below noise."""
    scene, view = shapes.box_room(), shapes.box_room_view((16, 12))
    if change == "lights end":
        view = shapes.box_room_view((16, 12), (replace(shapes.spot(), range=2.0), shapes.sun()))
    if change == "glows":
        materials = (replace(scene.materials[0], emission=(0.2, 0.1, 0.3)), *scene.materials[1:])
        scene = replace(scene, materials=materials, environment=even_sky((0.3, 0.2, 0.1)))
    arguments = {"seed": 3, "noise_target": 0.0, "max_samples": 32, "bounces": 2}
    base = reference_views(scene, (view,), **arguments)[0]
    (tmp_path / "job").write_bytes(pickle.dumps((scene, view, arguments)))
    program = (
        "import pickle, sys, numpy; from vpltune.tuner.reference import *;"
        "assert describe_variant().name == 'scalar_rgb';"
        "scene, view, arguments = pickle.load(open(sys.argv[1], 'rb'));"
        "r = reference_views(scene, (view,), **arguments)[0];"
        "numpy.savez(sys.argv[2], direct=r.direct_irradiance, a=r.irradiance_a, b=r.irradiance_b)"
    )
    subprocess.run(
        [sys.executable, "-W", "error", "-c", program, str(tmp_path / "job"), str(tmp_path / "made.npz")],
        env=os.environ | {"VPLTUNE_MITSUBA_VARIANT": "scalar_rgb"},
        check=True,
    )
    with np.load(tmp_path / "made.npz") as made:
        np.testing.assert_allclose(made["direct"], base.direct_irradiance, atol=1e-4)
        mean = base.irradiance.mean()
        for name, half in (("a", base.irradiance_a), ("b", base.irradiance_b)):
            # Because of rounding, a few of the 32 samples miss an edge in a few pixels.
            assert np.mean(np.abs(made[name] - half)) < 0.005 * mean


@pytest.mark.parametrize("count", [2, pytest.param(8, marks=pytest.mark.slow)])
def test_processes_make_a_reference_once(shapes, tmp_path, count):
    """All processes start at once on the same view. One renders; the others wait and load its result."""
    (tmp_path / "job").write_bytes(pickle.dumps((shapes.box_room(), shapes.box_room_view((32, 24)))))
    program = (
        "import pickle, sys; from vpltune.tuner.reference import references;"
        "scene, view = pickle.load(open(sys.argv[1], 'rb')); render = references._rendered\n"
        "def told(*rest):\n    print('rendered', flush=True)\n    return render(*rest)\n"
        "references._rendered = told\n"
        "references.reference_views(scene, (view,), noise_target=0.0, max_samples=1024)"
    )
    running = [
        subprocess.Popen(
            [sys.executable, "-c", program, str(tmp_path / "job")],
            env=os.environ | {"VPLTUNE_CACHE": str(tmp_path / "cache")},
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(count)
    ]
    said = "".join(process.communicate()[0] for process in running)
    assert [process.returncode for process in running] == [0] * count
    assert said.count("rendered") == 1
    assert [path.suffix for path in (tmp_path / "cache" / "references").iterdir()] == [".reference"]


def test_a_killed_renderer_hands_over_and_leaves_nothing(shapes, tmp_path):
    """A process is killed while it writes. The next renders the reference and deletes the partial file."""
    scene, view = shapes.box_room(), shapes.box_room_view((8, 6))
    (tmp_path / "job").write_bytes(pickle.dumps((scene, view)))
    program = (
        "import os, pickle, sys; from pathlib import Path; from vpltune.tuner.reference import references\n"
        "scene, view = pickle.load(open(sys.argv[1], 'rb'))\n"
        "def chmod(path, mode):\n    if path.suffix == '.reference': os.kill(os.getpid(), 9)\n"
        "if sys.argv[2] == 'dies': Path.chmod = chmod\n"
        "references.reference_views(scene, (view,), noise_target=0.0, max_samples=16)"
    )
    folder = tmp_path / "cache" / "references"
    for fate, code, left in (("dies", -9, [".lock", ".reference"]), ("lives", 0, [".reference"])):
        done = subprocess.run(
            [sys.executable, "-c", program, str(tmp_path / "job"), fate],
            env=os.environ | {"VPLTUNE_CACHE": str(tmp_path / "cache")},
        )
        assert done.returncode == code
        assert sorted(path.suffix for path in folder.iterdir()) == left


def test_a_lock_that_was_unlinked_under_a_waiting_process_keeps_others_off(monkeypatch, tmp_path):
    """The second thread waits on a file that is unlinked. It must not run beside the third, on a new file."""
    no_cache(monkeypatch, tmp_path)
    order = []

    def second():
        with cache.locked("key"):
            order.append("second")
            third.start()
            third.join(0.3)
            order.append("second out")

    def third_comes():
        with cache.locked("key"):
            order.append("third")

    third = threading.Thread(target=third_comes)
    waiting = threading.Thread(target=second)
    with cache.locked("key"):
        waiting.start()
        waiting.join(0.2)
    waiting.join()
    third.join()
    assert order == ["second", "second out", "third"]
    assert list((tmp_path / "references").iterdir()) == []


def test_leftovers_go_and_what_is_in_use_stays(monkeypatch, tmp_path):
    no_cache(monkeypatch, tmp_path)
    folder = tmp_path / "references"
    folder.mkdir()
    for name in ("dead.lock", f"{PREFIX}x1.reference", "kept.reference"):
        (folder / name).touch()
    with cache.locked("busy"), written_whole(folder / "new.reference") as busy:
        cache.remove_leftovers()
        assert {path.name for path in folder.iterdir()} == {"busy.lock", busy.name, "kept.reference"}
        busy.write_text("whole")
    (folder / "new.reference").unlink()
    cache.remove_leftovers()
    assert [path.name for path in folder.iterdir()] == ["kept.reference"]


@pytest.mark.parametrize("reason", [13, 28, 30], ids=["permission", "full", "read-only"])
def test_a_cache_that_cannot_be_written_to_stops_nothing(shapes, monkeypatch, tmp_path, caplog, reason):
    """A read-only home and a full disk: the reference is rendered, and a warning says that it is not kept."""
    no_cache(monkeypatch, tmp_path)

    def refuse(**_):
        raise OSError(reason, os.strerror(reason))

    monkeypatch.setattr(unfinished_files.tempfile, "mkstemp", refuse)  # root may write anywhere
    with pytest.raises(MachineError), written_whole(tmp_path / "x"):
        pass
    scene, view = shapes.box_room(), shapes.box_room_view()
    assert reference_views(scene, (view,), noise_target=0.0, max_samples=16, bounces=1)[0].samples == 16
    assert "reference not cached" in caplog.text
    assert os.strerror(reason) in caplog.text
