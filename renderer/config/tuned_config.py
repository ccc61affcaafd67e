"""The config file: what the tuner writes and the runtime reads.

    {"format": "vpltune", "version": 1, "parameters": {"intensity": 1.0, ...}, "provenance": {...}}

`parameters` holds every name of the table in `renderer.config.artist_parameters` and nothing else.
`visibility` ("none", "transmittance", "maps") says what stands for occluders; a file without it means
"maps". `auto` is optional: a learnt prior (`renderer.config.auto_prior`) that sets some of the parameters
anew in every frame; it goes with "maps". `provenance` is optional, says where the numbers come from, and is
never acted on.
"""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from vpltune.renderer.config.auto_prior import AutoPrior, auto_schema
from vpltune.renderer.config.gltf_extras import GLTF_SUFFIXES, read_gltf_extras
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole

FORMAT = "vpltune"
VERSION = 1
DEFAULT_CONFIG_NAME = "default"
AUTO_CONFIG_NAME = "auto"
PRESETS = (DEFAULT_CONFIG_NAME, AUTO_CONFIG_NAME)
# A real file is about 1 kB; the bound keeps a wrong path (a scene, a device) from being read whole.
MAXIMUM_FILE_BYTES = 1 << 20
LARGEST_NUMBER = sys.float_info.max

Visibility = Literal["none", "transmittance", "maps"]
VISIBILITIES: tuple[Visibility, ...] = get_args(Visibility)
DEFAULT_VISIBILITY: Visibility = "maps"

Provenance = Mapping[str, str | int | float]


@dataclass(frozen=True)
class TunedConfig:
    """Parameters, and where they come from."""

    parameters: ArtistParameters = field(default_factory=ArtistParameters)
    provenance: Provenance = field(default_factory=dict)
    """Free-form names to strings or finite numbers."""
    visibility: Visibility = DEFAULT_VISIBILITY
    """What stands for occluders between VPLs and surfaces: nothing, the mean transmittance exp(−κ·d/L), or a
    small map of what each VPL sees, with the transmittance for what the maps cannot resolve."""

    auto: AutoPrior | None = None
    """What sets some of the parameters on the GPU, frame by frame; needs the visibility "maps"."""

    def seen_by(self, visibility: Visibility | None) -> "TunedConfig":
        """The same config with another visibility; None keeps its own.

        Raises:
            InputError: the config has a prior, and the visibility is not the one that it was trained with.
        """
        if self.auto is not None and visibility not in (None, self.visibility):
            raise InputError(
                f"visibility: a config with 'auto' goes with {self.visibility}, got {visibility}"
            )
        return self if visibility is None else replace(self, visibility=visibility)


def read_config(source: str | Path) -> TunedConfig:
    """Read a config file, or for the words "default" and "auto" the preset in configs/.

    A .gltf or .glb holds a config where `vpltune export --to gltf` has put one into its extras.

    Raises:
        InputError: the file cannot be read, is not JSON, has another format or a later version,
            repeats, lacks or adds a key, or holds a value that is not finite and in range.
    """
    if str(source) in PRESETS:
        text = files("vpltune.configs").joinpath(f"{source}.json").read_text(encoding="utf-8")
        return parse_config(text, f"configs/{source}.json")
    path = Path(source)
    if path.suffix.lower() in GLTF_SUFFIXES:
        return parse_config(json.dumps(read_gltf_extras(path)), str(path))
    try:
        with path.open("rb") as file:
            content = file.read(MAXIMUM_FILE_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if len(content) > MAXIMUM_FILE_BYTES:
        raise InputError(f"{path}: a config is at most {MAXIMUM_FILE_BYTES} bytes long, this file is longer")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    return parse_config(text, str(path))


def parse_config(text: str, where: str) -> TunedConfig:
    """The config that `text` holds; `where` names its origin in errors. Raises as `read_config`."""
    try:
        document = json.loads(text, object_pairs_hook=_refuse_duplicates)
    except _DuplicateKeyError as error:
        raise InputError(f"{where}: key {str(error)!r:.60} stands there twice") from error
    # RecursionError: deep nesting; ValueError: bad syntax, or an integer of more than 4300 digits.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{where}: must be a JSON object, got {type(document).__name__}")
    _check_header(document, where)
    parameters = document["parameters"]
    if not isinstance(parameters, dict):
        raise InputError(f"{where}: key 'parameters' must be an object, got {type(parameters).__name__}")
    return TunedConfig(
        parameters=ArtistParameters.validated(parameters, f"{where}: parameters"),
        provenance=_checked_provenance(document.get("provenance", {}), where),
        visibility=_checked_visibility(document.get("visibility", DEFAULT_VISIBILITY), where),
        auto=_checked_auto(document, where),
    )


def write_config(path: Path, config: TunedConfig) -> None:
    """Write `config`, whole or not at all; what is written reads back equal.

    Raises:
        InputError: a value is out of range, or the path cannot be written to.
    """
    write_text_whole(Path(path), config_text(config))


def config_text(config: TunedConfig) -> str:
    """The file's text: keys in the table's order, numbers with all their digits.

    Raises:
        InputError: a value is out of range.
    """
    parameters = ArtistParameters.validated(config.parameters.as_dict())
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "visibility": _checked_visibility(config.visibility, "config"),
        "parameters": parameters.as_dict(),
    }
    if config.auto is not None:
        document["auto"] = config.auto.as_dict()
        _checked_auto(document, "config")
    if config.provenance:
        document["provenance"] = _checked_provenance(dict(config.provenance), "config")
    # Escaped to ASCII: a provenance may hold a file name that is not valid Unicode.
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def config_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the file, made from the parameter table."""
    properties = {
        spec.name: {
            "title": spec.symbol,
            "description": f"{spec.meaning} [{spec.unit}]",
            "type": "integer" if spec.whole_number else "number",
            "minimum": spec.low,
            "maximum": spec.high,
            # Says `minimum` once more, the other way round. NaN is no JSON, but parsers let it pass, and of
            # comparisons with it none fails: turned round, none succeeds.
            "not": {"exclusiveMaximum": spec.low},
            "default": spec.default,
        }
        for spec in ARTIST_PARAMETERS
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "VPLtune config",
        "description": "Tuned parameters of one-bounce indirect light; none has a world unit.",
        "type": "object",
        "required": ["format", "version", "parameters"],
        "additionalProperties": False,
        "properties": {
            "format": {"const": FORMAT},
            "version": {"const": VERSION},
            "parameters": {
                "type": "object",
                "required": list(properties),
                "additionalProperties": False,
                "properties": properties,
            },
            "visibility": {
                "description": "What stands for occluders between VPLs and surfaces.",
                "enum": list(VISIBILITIES),
                "default": DEFAULT_VISIBILITY,
            },
            "auto": auto_schema(),
            "provenance": {
                "description": "Where the numbers come from; never acted on.",
                "type": "object",
                "additionalProperties": {
                    "type": ["string", "number"],
                    "minimum": -LARGEST_NUMBER,
                    "maximum": LARGEST_NUMBER,
                    "not": {"type": "number", "exclusiveMaximum": -LARGEST_NUMBER},
                },
            },
        },
    }


class _DuplicateKeyError(ValueError):
    """A key stands twice in one JSON object; the standard reader would keep the last and say nothing."""


def _refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members: dict[str, Any] = {}
    for key, value in pairs:
        if key in members:
            raise _DuplicateKeyError(key)
        members[key] = value
    return members


def _check_header(document: dict[str, Any], where: str) -> None:
    for key in ("format", "version", "parameters"):
        if key not in document:
            raise InputError(f"{where}: key '{key}' is missing")
    if document["format"] != FORMAT:
        raise InputError(f"{where}: key 'format' must be '{FORMAT}', got {document['format']!r:.60}")
    version = document["version"]
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise InputError(f"{where}: key 'version' must be a whole number from 1, got {version!r:.60}")
    if version > VERSION:
        raise InputError(f"{where}: key 'version' is {version!s:.20}, this program reads up to {VERSION}")
    known = ("format", "version", "visibility", "parameters", "auto", "provenance")
    for key in document:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(known)}")


def _checked_visibility(visibility: Any, where: str) -> Visibility:
    if visibility not in VISIBILITIES:
        raise InputError(
            f"{where}: key 'visibility' must be one of {', '.join(VISIBILITIES)}, got {visibility!r:.60}"
        )
    return visibility


def _checked_auto(document: dict[str, Any], where: str) -> AutoPrior | None:
    if "auto" not in document:
        return None
    if document.get("visibility") != "maps":
        raise InputError(
            f"{where}: key 'auto' goes with visibility 'maps', got {document.get('visibility')!r}"
        )
    relaxation = document["parameters"]["density_relaxation"]
    if relaxation != 0:
        raise InputError(
            f"{where}: key 'auto' goes with parameters.density_relaxation 0, for its α is that of points, "
            f"got {relaxation}"
        )
    return AutoPrior.validated(document["auto"], f"{where}: auto")


def _checked_provenance(provenance: Any, where: str) -> dict[str, str | int | float]:
    if not isinstance(provenance, dict):
        raise InputError(f"{where}: key 'provenance' must be an object, got {type(provenance).__name__}")
    for key, value in provenance.items():
        number = (
            isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_NUMBER
        )
        if not (number or isinstance(value, str)):
            raise InputError(
                f"{where}: provenance.{key!r:.60} must be a string or a finite number, got {value!r:.60}"
            )
    return provenance
