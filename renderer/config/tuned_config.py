"""The config file: what the tuner writes, and all that decides an image beside scene and view.

    {"format": "vpltune", "version": 2, "visibility": "maps", "quality": {"interleave": 4, ...},
     "parameters": {"intensity": 1.0, ...}, "fit": {"status": "improved", ...}, "checksum": "sha256:..."}

| key | meaning |
|---|---|
| `parameters` | every name of the table in `renderer.config.artist_parameters`, and no other |
| `quality` | settings that trade quality for frame time (`renderer.config.quality`); optional |
| `visibility` | what occludes VPLs: `maps`, or `transmittance` alone; optional, `maps` by default |
| `auto` | a learnt prior that sets some parameters in every frame (`renderer.config.auto_prior`); optional |
| `fit` | how the fit that wrote the file ended; optional |
| `light` | which of the scene's light is drawn: `bounces`, 1 to 64 or "all"; without it, one bounce |
| `provenance` | where the numbers come from; kept and not acted on; optional |
| `checksum` | SHA-256 of all the rest; optional, but a wrong one is refused |

Version 1 is read too (`renderer.config.config_versions`).
"""

import hashlib
import json
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AutoPrior
from vpltune.renderer.config.config_versions import brought_forward
from vpltune.renderer.config.gltf_extras import GLTF_SUFFIXES, read_gltf_extras
from vpltune.renderer.config.light_settings import ONE_BOUNCE, LightSettings
from vpltune.renderer.config.member_rules import whole_as_int
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.small_text import read_small_text
from vpltune.renderer.files.strict_json import DuplicateKeyError, unique_keys

FORMAT = "vpltune"
VERSION = 2
"""Version that is written; version 1 is read too."""
DEFAULT_CONFIG_NAME = "default"
AUTO_CONFIG_NAME = "auto"
PRESETS = (DEFAULT_CONFIG_NAME, AUTO_CONFIG_NAME)
# A real file is about 1 kB; the bound keeps a wrong path (a scene, a device) from being read whole.
MAXIMUM_FILE_BYTES = 1 << 20
LARGEST_NUMBER = sys.float_info.max
KEYS = (
    "format",
    "version",
    "visibility",
    "quality",
    "parameters",
    "auto",
    "light",
    "fit",
    "provenance",
    "checksum",
)

Visibility = Literal["transmittance", "maps"]
VISIBILITIES: tuple[Visibility, ...] = get_args(Visibility)
DEFAULT_VISIBILITY: Visibility = "maps"

Provenance = Mapping[str, str | int | float]
_QUALITY_PARAMETERS = tuple(spec.name for spec in ARTIST_PARAMETERS if spec.part == "quality")
_CHECKSUM_PREFIX = "sha256:"


@dataclass(frozen=True)
class FitNote:
    """How the fit that wrote a config ended."""

    status: str
    """`improved`, `kept`, `unlit` or `doubtful`."""
    sentence: str = ""


@dataclass(frozen=True)
class TunedConfig:
    """All that decides an image beside the scene and the view."""

    parameters: ArtistParameters = field(default_factory=ArtistParameters)
    provenance: Provenance = field(default_factory=dict)
    """Free-form names to strings or finite numbers."""
    visibility: Visibility = DEFAULT_VISIBILITY
    """What occludes VPLs: a small map of what each VPL sees, with the mean transmittance exp(−κ·d/L) for what
    maps cannot resolve; or that transmittance alone."""
    auto: AutoPrior | None = None
    """Sets some of the parameters on the GPU, frame by frame; needs the visibility `maps`."""
    quality: Quality = field(default_factory=Quality)
    fit: FitNote | None = None
    light: LightSettings = field(default_factory=LightSettings)

    def __repr__(self) -> str:
        fitted = ("intensity", "falloff_footprint", "extinction_coefficient")
        values = [f"{parameter_spec(name).symbol} {getattr(self.parameters, name):.4g}" for name in fitted]
        said = ["auto"] if self.auto is not None else values
        said += [f"{self.parameters.vpl_count} VPLs", self.visibility]
        said += [] if self.fit is None else [self.fit.status]
        return f"TunedConfig({', '.join(said)})"

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

    def with_parameters(self, parameters: ArtistParameters) -> "TunedConfig":
        """The same config with these parameters, which replace its prior too."""
        return replace(self, parameters=parameters, auto=None)

    def draws_as(self, other: "TunedConfig") -> bool:
        """Whether both draw the same images."""
        return (self.parameters, self.visibility, self.auto, self.quality, self.light) == (
            other.parameters,
            other.visibility,
            other.auto,
            other.quality,
            other.light,
        )

    def with_full_gather(self) -> "TunedConfig":
        """The same config with every VPL gathered at every pixel, which is what the surrogate computes."""
        return replace(self, quality=replace(self.quality, interleave=1))


def read_config(source: str | Path, *, check: bool = True) -> TunedConfig:
    """Read a config file, or for the words "default" and "auto" the preset in configs/.

    A .gltf or .glb holds a config where `vpltune export --to gltf` has put one into its extras. `check` False
    accepts a wrong checksum.

    Raises:
        InputError: the file cannot be read, is not JSON, has another format or a later version, repeats,
            lacks or adds a key, holds a value that is not finite and in range, or its checksum is wrong.
    """
    if str(source) in PRESETS:
        text = files("vpltune.configs").joinpath(f"{source}.json").read_text(encoding="utf-8")
        return parse_config(text, f"configs/{source}.json", check=check)
    path = Path(source)
    if path.suffix.lower() in GLTF_SUFFIXES:
        return parse_config(json.dumps(read_gltf_extras(path)), str(path), check=check)
    return parse_config(read_small_text(path, MAXIMUM_FILE_BYTES), str(path), check=check)


def parse_config(text: str, where: str, *, check: bool = True) -> TunedConfig:
    """The config that `text` holds; `where` names its origin in errors. Raises as `read_config`."""
    try:
        document = json.loads(text, object_pairs_hook=unique_keys)
    except DuplicateKeyError as error:
        raise InputError(f"{where}: key {str(error)!r:.60} appears twice") from error
    # RecursionError: deep nesting; ValueError: bad syntax, or an integer of more than 4300 digits.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{where}: must be a JSON object, got {type(document).__name__}")
    _check_header(document, where)
    if document["version"] < VERSION:
        document = brought_forward(document, where)
    config = _config(document, where)
    if check and "checksum" in document:
        _check_checksum(document["checksum"], config, where)
    return config


def write_config(path: Path, config: TunedConfig) -> None:
    """Write `config`, whole or not at all; what is written reads back equal.

    Raises:
        InputError: a value is out of range, or the path cannot be written to.
    """
    write_text_whole(Path(path), config_text(config))


def config_text(config: TunedConfig) -> str:
    """The file's text: keys in the table's order, numbers with all their digits, and the checksum.

    Raises:
        InputError: a value is out of range.
    """
    document = _document(config)
    _config(json.loads(json.dumps(document)), "config")
    document["checksum"] = _checksum(document)
    # Escaped to ASCII: a provenance may hold a file name that is not valid Unicode.
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _document(config: TunedConfig) -> dict[str, Any]:
    """The file's content without its checksum; values are not checked."""
    parameters = config.parameters.as_dict()
    in_quality = {name: parameters.pop(name) for name in _QUALITY_PARAMETERS}
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "visibility": config.visibility,
        "quality": {**config.quality.as_dict(), **in_quality},
        "parameters": parameters,
    }
    if config.auto is not None:
        document["auto"] = config.auto.as_dict()
    document["light"] = config.light.as_dict()
    if config.fit is not None:
        document["fit"] = {"status": config.fit.status, "sentence": config.fit.sentence}
    if config.provenance:
        document["provenance"] = dict(config.provenance)
    return document


def _config(document: dict[str, Any], where: str) -> TunedConfig:
    """The config of a document of the present version, checked but for its checksum."""
    for key in document:
        if key not in KEYS:
            raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(KEYS)}")
    parameters = _object(document, "parameters", where)
    quality = dict(_object(document, "quality", where))
    for name in _QUALITY_PARAMETERS:
        if name in parameters:
            raise InputError(f"{where}: parameters: unknown key '{name}'; it belongs in 'quality'")
        default = next(spec.default for spec in ARTIST_PARAMETERS if spec.name == name)
        parameters = {**parameters, name: quality.pop(name, default)}
    fit = _object(document, "fit", where) if "fit" in document else None
    return TunedConfig(
        parameters=_checked_parameters(parameters, where),
        provenance=_checked_provenance(document.get("provenance", {}), where),
        visibility=_checked_visibility(document.get("visibility", DEFAULT_VISIBILITY), where),
        auto=_checked_auto(document, where),
        quality=Quality.validated(quality, f"{where}: quality", _QUALITY_PARAMETERS),
        fit=None if fit is None else _checked_fit(fit, where),
        light=LightSettings.validated(document.get("light", {}), f"{where}: light"),
    )


def _checked_parameters(parameters: Mapping[str, Any], where: str) -> ArtistParameters:
    for spec in ARTIST_PARAMETERS:
        if spec.part == "quality":
            spec.checked(parameters[spec.name], f"{where}: quality")
    return ArtistParameters.validated(parameters, f"{where}: parameters")


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


def _object(document: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    value = document.get(key, {})
    if not isinstance(value, dict):
        raise InputError(f"{where}: key '{key}' must be an object, got {type(value).__name__}")
    return value


def _checked_visibility(visibility: Any, where: str) -> Visibility:
    if visibility not in VISIBILITIES:
        raise InputError(
            f"{where}: key 'visibility' must be one of {', '.join(VISIBILITIES)}, got {visibility!r:.60}"
        )
    return visibility


def _checked_auto(document: dict[str, Any], where: str) -> AutoPrior | None:
    if "auto" not in document:
        return None
    visibility = document.get("visibility", DEFAULT_VISIBILITY)
    if visibility != "maps":
        raise InputError(f"{where}: key 'auto' goes with visibility 'maps', got {visibility!r}")
    return AutoPrior.validated(document["auto"], f"{where}: auto")


def _checked_fit(fit: dict[str, Any], where: str) -> FitNote:
    for key, value in fit.items():
        if key not in ("status", "sentence"):
            raise InputError(f"{where}: fit: unknown key {key!r:.60}; known are status, sentence")
        if not isinstance(value, str):
            raise InputError(f"{where}: fit.{key}: must be a string, got {value!r:.60}")
    if "status" not in fit:
        raise InputError(f"{where}: fit: key 'status' is missing")
    return FitNote(**fit)


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


def _check_checksum(checksum: Any, config: TunedConfig, where: str) -> None:
    document = _document(config)
    right = [_checksum(document)]
    if config.light == ONE_BOUNCE:
        # Files that are older than the key have a checksum without it.
        del document["light"]
        right.append(_checksum(document))
    if checksum not in right:
        file = shlex.quote(where)
        # JSON alone in the place of a glTF file would be the end of its scene.
        form = f"gltf --scene {file}" if Path(where).suffix.lower() in GLTF_SUFFIXES else "json"
        raise InputError(
            f"{where}: key 'checksum' does not fit the values; after an edit by hand, renew it: "
            f"vpltune export {file} --to {form} -o {file} --renew-checksum"
        )


def _checksum(document: dict[str, Any]) -> str:
    """Taken of the values, so that a file may be formatted anew: sorted keys, no blanks, 15.0 as 15."""
    canonical = json.dumps(_canonical(document), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return _CHECKSUM_PREFIX + hashlib.sha256(canonical.encode("ascii")).hexdigest()


def _canonical(value: Any) -> Any:
    """JSON has one kind of number, and some programs write 15.0 as 15."""
    if isinstance(value, dict):
        return {key: _canonical(member) for key, member in value.items()}
    if isinstance(value, list):
        return [_canonical(member) for member in value]
    return whole_as_int(value)
