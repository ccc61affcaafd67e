"""`vpltune export`: writes a config for another program, alone or with a scene to draw."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from vpltune.cli.options import JsonOption, VisibilityOption
from vpltune.cli.report import Report, warn
from vpltune.cli.view_options import (
    ImageSizeOption,
    ViewFlags,
    ViewNameOption,
    ViewsFileOption,
    takes_view_flags,
)
from vpltune.renderer.errors import InputError

if TYPE_CHECKING:
    from vpltune.cli.chosen_view import ChosenView
    from vpltune.renderer.config.tuned_config import TunedConfig
    from vpltune.renderer.export.config_export import ExportFormat
    from vpltune.renderer.export.scene_bundle import SceneBundle

Form = Literal["json", "glsl", "c", "std140", "gltf", "bundle", "web"]
WITH_SCENE = ("gltf", "bundle", "web")
WITH_VIEW: Final = ("bundle", "web")
WITH_CHECKSUM: Final = ("json", "gltf")


@takes_view_flags
def export(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="A config, a glTF file that carries one, `default` or `auto`.",
            show_default=False,
        ),
    ],
    to: Annotated[
        Form,
        typer.Option(
            help="json: the config; glsl: constants or a uniform block; c: a header; std140: the bytes of "
            "the block; gltf: a copy of --scene with the config in its extras; bundle: all that draws "
            "--scene, as JSON and .bin; web: a page that draws --scene."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT", help="File to write; for a bundle, a folder."),
    ],
    scene: Annotated[
        Path | None,
        typer.Option(metavar="SCENE", help="Scene for gltf, bundle and web.", show_default=False),
    ] = None,
    size: ImageSizeOption = None,
    visibility: VisibilityOption = None,
    views: ViewsFileOption = None,
    view: ViewNameOption = None,
    renew_checksum: Annotated[
        bool,
        typer.Option("--renew-checksum", help="For json and gltf: accept a config that was edited by hand."),
    ] = False,
    *,
    flags: ViewFlags,
    json: JsonOption = False,
) -> Report:
    """Write a config for another program: as text, as bytes, in a glTF scene, or with a scene to draw."""
    from rich.markup import escape

    from vpltune.cli.quality_flags import with_flags
    from vpltune.renderer.config.tuned_config import read_config
    from vpltune.renderer.files.atomic_file import require_writable

    if to in WITH_SCENE and scene is None:
        raise InputError(f"--scene: must be given with --to {to}")
    if to not in WITH_SCENE and scene is not None:
        raise InputError(f"--scene: cannot be given with --to {to}")
    if to not in WITH_VIEW and (flags != ViewFlags() or views or view or size):
        raise InputError(
            f"--to {to}: takes no camera, light, view or size; --to {' and '.join(WITH_VIEW)} do"
        )
    if to == "web" and output.suffix.lower() != ".html":
        raise InputError(f"{output}: the file name must end in .html, got {output.suffix or 'no suffix'!r}")
    if renew_checksum and to not in WITH_CHECKSUM:
        raise InputError(f"--renew-checksum: needs --to {' or '.join(WITH_CHECKSUM)}, got --to {to}")
    require_writable(output if to == "bundle" else output.parent)
    config, overridden = with_flags(read_config(file, check=not renew_checksum), visibility=visibility)
    warn(overridden)
    fit = fit_outcome(config)
    warn(fit_warnings(config))
    if to in WITH_VIEW:
        from vpltune.cli.chosen_view import chosen_view
        from vpltune.renderer.export.config_export import refuse_prior

        refuse_prior(config, to)
        assert scene is not None
        _write_with_view(to, output, _bundle(config, scene, chosen_view(views, view, size, flags)))
    else:
        _write(config, to, output, scene)
    document = {
        "output": str(output),
        "to": to,
        "visibility": config.visibility,
        "parameters": config.parameters.as_dict(),
        **({} if fit is None else {"fit": fit}),
        "status": "ok",
    }
    return Report(document, (f"wrote {escape(str(output))}",))


def fit_outcome(config: "TunedConfig") -> str | None:
    """How the fit that wrote the config ended; None if no fit wrote it or its outcome is unknown."""
    return None if config.fit is None else config.fit.status


def fit_warnings(config: "TunedConfig") -> tuple[str, ...]:
    """A warning if the config is not better than the start of its fit; else empty."""
    fit = config.fit
    if fit is None or fit.status == "improved":
        return ()
    return (f"this config is from a fit that ended {fit.status}: {fit.sentence or 'no reason given'}",)


def _write(
    config: "TunedConfig", to: "ExportFormat | Literal['gltf']", output: Path, scene: Path | None
) -> None:
    import json

    from vpltune.renderer.config.gltf_extras import write_gltf_extras
    from vpltune.renderer.config.tuned_config import config_text
    from vpltune.renderer.export.config_export import beyond_constants, exported
    from vpltune.renderer.files.atomic_file import written_whole

    if to == "gltf":
        assert scene is not None
        write_gltf_extras(scene, output, json.loads(config_text(config)))
        return
    warn(beyond_constants(config, to))
    content = exported(config, to)
    with written_whole(output) as temporary:
        temporary.write_bytes(content)


def _bundle(config: "TunedConfig", scene: Path, chosen: "ChosenView") -> "SceneBundle":
    from vpltune.renderer.export.scene_bundle import scene_bundle

    loaded = chosen.read(scene)
    drawn = chosen.placed(loaded, scene)
    if loaded.animation is not None:
        warn(("the scene's animation is left out: the scene is exported at rest",))
    return scene_bundle(loaded, drawn, config)


def _write_with_view(to: Form, output: Path, bundle: "SceneBundle") -> None:
    from vpltune.renderer.export.scene_bundle import write_bundle
    from vpltune.renderer.export.web_page import web_page
    from vpltune.renderer.files.atomic_file import write_text_whole

    warn(bundle.left_out)
    if to == "bundle":
        write_bundle(output, bundle)
    else:
        write_text_whole(output, web_page(bundle))
