"""`vpltune.fit`: scenes in memory, views of one's own, a loss of one's own."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import colored_room, room_view
from quick_fit import QUICK_FIT

import vpltune
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.views import checked_view, read_views
from vpltune.tuner.frame_time.fit_budget import BudgetOptions
from vpltune.tuner.reference.content_key import scene_digest

START = TunedConfig(replace(QUICK_FIT, intensity=1.6))
"""Too bright: the right intensity is about 1."""
SMALL = (24, 18)


def log_error(predicted, reference):
    dark = 0.01 * reference.mean()
    return jnp.mean(jnp.log((predicted + dark) / (reference + dark)) ** 2)


def own_views():
    fitted = room_view(size=SMALL), room_view("point", size=SMALL)
    validation = (room_view(light, size=SMALL) for light in ("spot", "point", "wide_spot"))
    return (
        *fitted,
        *(replace(view, name=f"v{i}", split="validation") for i, view in enumerate(validation)),
        replace(room_view(size=SMALL), name="h", split="held_out"),
    )


@pytest.mark.slow
def test_a_fit_of_a_scene_in_memory(tmp_path):
    """The files say what the result says; the scene has a name and no file."""
    room = colored_room()
    views = own_views()
    result = vpltune.fit(room, tmp_path / "out", views=views, config=START)
    assert [view.name for view in result.views] == [
        view.name for split in ("fitted", "held_out", "validation") for view in views if view.split == split
    ]
    document = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    assert document["scene"] == "colored-room"
    assert document["loss"]["function"] is None
    provenance = read_config(tmp_path / "out" / "tuned.json").provenance
    assert provenance["scene_content_sha256"] == scene_digest(room)
    assert "scene_file_sha256" not in provenance
    assert (
        json.loads((tmp_path / "out" / "views.json").read_text(encoding="utf-8"))["scene"] == "colored-room"
    )
    assert [view.name for view in read_views(tmp_path / "out" / "views.json")] == [
        view.name for view in result.views
    ]
    assert result.status == "improved"
    assert result.config.parameters.intensity == pytest.approx(1.0, abs=0.15)  # what 18 % of noise leave


@pytest.mark.slow
def test_a_loss_of_ones_own_is_what_the_fit_minimises(tmp_path, monkeypatch):
    """It ends below the start; nothing is written without a folder; placement and maps are the start's."""
    monkeypatch.chdir(tmp_path)
    result = vpltune.fit(colored_room(), views=own_views(), config=START, loss=log_error)
    assert list(tmp_path.iterdir()) == []
    assert result.document["views"] is None
    assert result.document["loss"]["function"] == "log_error"
    assert result.document["uncertainty"] == {}
    assert result.descent.loss < 0.9 * result.descent.start_loss
    moved = {"intensity", "falloff_footprint", "extinction_coefficient"}
    start, fitted = START.parameters.as_dict(), result.fitted.as_dict()
    assert {name for name in start if start[name] != fitted[name]} <= moved
    assert result.fitted.intensity == pytest.approx(1.0, abs=0.15)
    # The guard judged it by its own measures, which an intensity that far off is clear in.
    assert result.status == "improved"
    assert [each["name"] for each in result.document["validation"]["candidates"]] == ["halfway", "tuned"]


@pytest.mark.slow
def test_a_loss_that_the_measures_contradict_is_not_accepted():
    """The darkest image has the least of this loss: the start is kept, and `fitted` has what was found.

    Nor does the learnt prior take the start's place, which knows nothing of the loss.
    """
    result = vpltune.fit(
        colored_room(), views=own_views(), config=START, loss=lambda predicted, reference: predicted.mean()
    )
    assert result.status == "kept"
    assert result.config.parameters == START.parameters
    assert result.fitted.intensity < 0.5
    assert result.changes() == {}


BAD_VIEWS = {
    "views: must be at least one, got none": (),
    r"views\[1\].split: must be one of fitted, validation, held_out, got 'fit'": (
        room_view(),
        replace(room_view(), split="fitted"),
    ),
    r"views\[0\].size: must be two whole numbers": (replace(room_view(), size=(0, 4)),),
    r"views\[0\].camera.yfov: must lie in": (replace(room_view(), camera=vpltune.Camera(np.eye(4), 4.0)),),
    r"views\[0\].lights\[0\].intensity: must not be negative": (
        replace(room_view(), lights=(vpltune.Light("point", -1.0),)),
    ),
}


@pytest.mark.parametrize("message", BAD_VIEWS)
def test_views_are_held_to_the_rules_of_the_file(message):
    views = BAD_VIEWS[message]
    if "split" in message:
        # Set behind the back of the check of types, which is on in tests alone.
        object.__setattr__(views[1], "split", "fit")
    with pytest.raises(InputError, match=f"^{message}"):
        vpltune.fit(colored_room(), views=views)


def test_no_views_at_all_is_one_line():
    with pytest.raises(InputError, match="views: must be at least one, got none"):
        vpltune.fit(colored_room(), views=0)


def test_a_view_keeps_the_names_that_the_file_has_not():
    view = room_view()
    named = replace(
        view,
        camera=vpltune.Camera(view.camera.to_world, view.camera.yfov, "eye"),
        lights=(vpltune.Light("point", 1.0, [0, 0.5, 0], name="lamp"),),
    )
    checked = checked_view(named, "view")
    assert (checked.camera.name, checked.lights[0].name) == ("eye", "lamp")
    np.testing.assert_array_equal(checked.camera.to_world, view.camera.to_world)
    assert repr(checked) == "View('spot', fitted, 64×48, eye (0, 0, 3.6), point)"


def test_what_excludes_each_other_is_one_line():
    budget = BudgetOptions(5.0)
    with pytest.raises(InputError, match="loss: cannot be fitted to a frame-time budget"):
        vpltune.fit(colored_room(), loss=log_error, budget=budget)
    with pytest.raises(
        InputError, match="output: must be a folder for the files of a Pareto front, got None"
    ):
        vpltune.fit(colored_room(), budget=replace(budget, pareto=True))


def test_a_scene_without_triangles_is_one_line():
    with pytest.raises(InputError, match="scene 'empty': the scene has no triangles"):
        vpltune.fit(vpltune.Scene("empty", (), (), ()))
