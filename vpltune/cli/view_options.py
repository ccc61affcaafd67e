"""The options for the view that a command draws or fits, defined once for all commands."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from vpltune.cli.report import Report

VIEW_PANEL = "Camera and light, in world units (default: the scene's own, or placed automatically)"

ImageSizeOption = Annotated[str | None, typer.Option(metavar="WxH", help="Image size, in pixels. [960x540]")]
ViewsFileOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Take camera, lights and size from a views.json.")
]
ViewNameOption = Annotated[str | None, typer.Option(metavar="NAME", help="View of the --views file.")]


def _view_option(metavar: str, description: str) -> typer.models.OptionInfo:
    return typer.Option(metavar=metavar, help=description, show_default=False, rich_help_panel=VIEW_PANEL)


SkyOption = Annotated[
    str | None,
    _view_option("L or R,G,B", "Radiance of an even sky in W/(m² sr), in place of the scene's; 0 for none."),
]
EnvironmentOption = Annotated[
    Path | None, _view_option("FILE", "An equirectangular map of the sky, .exr or .hdr.")
]


@dataclass(frozen=True)
class ViewFlags:
    """Camera, light and sky as given on the command line; None if a flag is absent."""

    camera: Annotated[
        str | None, _view_option("NAME", "A camera of the file, by name or number; for fits also `all`.")
    ] = None
    eye: Annotated[str | None, _view_option("X,Y,Z", "Position of the camera.")] = None
    look_at: Annotated[str | None, _view_option("X,Y,Z", "Point it looks at, with +Y up.")] = None
    yfov: Annotated[float | None, _view_option("DEG", "Vertical field of view, in degrees. [50]")] = None
    light_type: Annotated[
        Literal["spot", "point", "directional"] | None, _view_option("TYPE", "spot, point or directional.")
    ] = None
    light_position: Annotated[str | None, _view_option("X,Y,Z", "Position of a spot or point light.")] = None
    light_look_at: Annotated[str | None, _view_option("X,Y,Z", "Point that the light is aimed at.")] = None
    light_direction: Annotated[str | None, _view_option("X,Y,Z", "Direction the light travels in.")] = None
    light_intensity: Annotated[
        str | None, _view_option("I or R,G,B", "W/sr (spot, point) or W/m² (directional). [1]")
    ] = None
    light_cone: Annotated[
        str | None, _view_option("INNER,OUTER", "Half angles of a spot, in degrees. [0,45]")
    ] = None
    light_range: Annotated[
        float | None, _view_option("R", "Where a spot or point light ends, in world units. [no end]")
    ] = None
    sky: SkyOption = None
    environment: EnvironmentOption = None

    @property
    def place_a_view(self) -> bool:
        """Whether a flag of camera or light is given, which a views.json has of its own."""
        return replace(self, sky=None, environment=None) != ViewFlags()


def takes_view_flags(command: Callable[..., Report]) -> Callable[..., Report]:
    """Decorate a command: its parameter `flags: ViewFlags` becomes one command-line option for each field.

    typer reads the options from the signature of the command, so the signature is changed.
    """
    names = [field.name for field in fields(ViewFlags)]

    @functools.wraps(command)
    def with_options(**given: Any) -> Report:
        flags = ViewFlags(**{name: given.pop(name) for name in names})
        return command(**given, flags=flags)

    parameters = []
    for parameter in inspect.signature(command).parameters.values():
        if parameter.annotation is ViewFlags:
            parameters += [
                parameter.replace(name=field.name, default=field.default, annotation=field.type)
                for field in fields(ViewFlags)
            ]
        else:
            parameters.append(parameter)
    # `Any`: the type of a function has no signature of its own to set.
    typed: Any = with_options
    typed.__signature__ = inspect.Signature(parameters, return_annotation=Report)
    typed.__annotations__ = {each.name: each.annotation for each in parameters}
    return typed
