"""Camera, light and sky from flags, and the rules for which flags may be given together."""

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from vpltune.cli.options import parse_numbers
from vpltune.cli.view_options import ViewFlags
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.environment_file import ENVIRONMENT_SUFFIXES, is_environment_file
from vpltune.renderer.scene.files.limits import ENDLESS_RANGE, LARGEST_RADIOMETRIC
from vpltune.renderer.scene.light_range import checked_range
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.spot_cone import checked_cone
from vpltune.renderer.scene.transforms import look_at

DEFAULT_YFOV_DEGREES = 50.0
"""Vertical field of view. A choice."""
DEFAULT_CONE_DEGREES = (0.0, 45.0)
"""Inner and outer half angle of a spot: the defaults of KHR_lights_punctual."""


def camera_from_flags(flags: ViewFlags) -> Camera | None:
    """The camera that the flags describe; None if no flag of a camera is given.

    Raises:
        InputError: a flag is missing, or a value is out of range.
    """
    if flags.eye is None and flags.look_at is None and flags.yfov is None:
        return None
    if flags.camera is not None:
        raise InputError(
            "--camera: a camera of the file has its own place; leave out --eye, --look-at, --yfov"
        )
    if flags.eye is None or flags.look_at is None:
        raise InputError("--eye and --look-at: a camera needs both")
    eye = _vector(flags.eye, "--eye")
    target = _vector(flags.look_at, "--look-at")
    if (eye == target).all():
        raise InputError(f"--look-at: must differ from --eye, got {flags.look_at} for both")
    yfov = DEFAULT_YFOV_DEGREES if flags.yfov is None else flags.yfov
    if not 1.0 <= yfov <= 170.0:
        raise InputError(f"--yfov: must be from 1 to 170 degrees, got {yfov}")
    return Camera(look_at(eye, target), math.radians(yfov))


def light_from_flags(flags: ViewFlags) -> Light | None:
    """The light that the flags describe; None if no flag of a light is given.

    Raises:
        InputError: a flag is missing, does not belong to the type of light, or has a value out of range.
    """
    given = {
        "--light-position": flags.light_position,
        "--light-look-at": flags.light_look_at,
        "--light-direction": flags.light_direction,
        "--light-intensity": flags.light_intensity,
        "--light-cone": flags.light_cone,
        "--light-range": flags.light_range,
    }
    present = [flag for flag, value in given.items() if value is not None]
    if flags.light_type is None:
        if present:
            raise InputError(f"--light-type: must be given with {present[0]}")
        return None
    intensity = _intensity(flags.light_intensity)
    if flags.light_type == "point":
        _refuse(present, "point", "--light-look-at", "--light-direction", "--light-cone")
        return Light("point", intensity, _position(flags), name="from flags", range=_range(flags))
    if flags.light_type == "directional":
        _refuse(present, "directional", "--light-cone", "--light-range")
        if flags.light_position is not None and flags.light_look_at is None:
            raise InputError("--light-position: a directional light takes it only with --light-look-at")
        return Light("directional", intensity, direction_world=_direction(flags), name="from flags")
    inner, outer = _cone(flags.light_cone)
    place, direction, reach = _position(flags), _direction(flags), _range(flags)
    return Light("spot", intensity, place, direction, inner, outer, name="from flags", range=reach)


def sky_from_flags(sky: str | None, environment: Path | None) -> GivenSky | None:
    """The sky of `--sky` or `--environment`; None if neither is given.

    Raises:
        InputError: both are given, or a value is out of range.
    """
    if sky is not None and environment is not None:
        raise InputError("--sky and --environment: only one of them can be given")
    if environment is not None:
        if not is_environment_file(environment.name):
            raise InputError(
                f"--environment: must end in {' or '.join(ENVIRONMENT_SUFFIXES)}, "
                f"got {str(environment)!r:.60}"
            )
        return GivenSky(file=str(environment))
    if sky is None:
        return None
    numbers = parse_numbers(sky, "--sky", (1, 3))
    if min(numbers) < 0.0 or max(numbers) > LARGEST_RADIOMETRIC:
        raise InputError(f"--sky: must be from 0 to {LARGEST_RADIOMETRIC:g}, got {sky:.60}")
    red, green, blue = numbers * (3 // len(numbers))
    return GivenSky((red, green, blue))


def _vector(text: str, flag: str) -> Float64[np.ndarray, "3"]:
    return np.array(parse_numbers(text, flag, (3,)), np.float64)


def _intensity(text: str | None) -> Float64[np.ndarray, "3"]:
    numbers = [1.0] if text is None else parse_numbers(text, "--light-intensity", (1, 3))
    if min(numbers) < 0.0 or max(numbers) == 0.0:
        raise InputError(f"--light-intensity: must not be negative or all zero, got {text}")
    return np.array(numbers * (3 // len(numbers)), np.float64)


def _position(flags: ViewFlags) -> Float64[np.ndarray, "3"]:
    if flags.light_position is None:
        raise InputError(f"--light-position: must be given for a {flags.light_type} light")
    return _vector(flags.light_position, "--light-position")


def _direction(flags: ViewFlags) -> Float64[np.ndarray, "3"]:
    if (flags.light_direction is None) == (flags.light_look_at is None):
        raise InputError(
            f"--light-direction: a {flags.light_type} light needs either this or --light-look-at, not both"
        )
    if flags.light_direction is not None:
        flag, direction = "--light-direction", _vector(flags.light_direction, "--light-direction")
    else:
        flag, direction = (
            "--light-look-at",
            _vector(str(flags.light_look_at), "--light-look-at") - _position(flags),
        )
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        raise InputError(f"{flag}: must give the light a direction, got a vector of length 0")
    return direction / length


def _cone(text: str | None) -> tuple[float, float]:
    inner, outer = DEFAULT_CONE_DEGREES if text is None else parse_numbers(text, "--light-cone", (2,))
    return checked_cone(inner, outer, "degrees", "--light-cone")


def _range(flags: ViewFlags) -> float:
    reach = math.inf if flags.light_range is None else checked_range(flags.light_range, "--light-range")
    return reach if reach < ENDLESS_RANGE else math.inf


def _refuse(present: list[str], light_type: str, *flags: str) -> None:
    for flag in flags:
        if flag in present:
            raise InputError(f"{flag}: a {light_type} light has none")
