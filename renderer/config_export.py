"""A tuned config as another program takes it: normalised JSON, or constants for a shader."""

from typing import Literal

from renderer.artist_parameters import ARTIST_PARAMETERS, ParameterSpec
from renderer.tuned_config import TunedConfig, config_text

ExportFormat = Literal["json", "glsl"]


def exported(config: TunedConfig, export_format: ExportFormat) -> str:
    """The text of the export.

    Raises:
        InputError: a value is out of range.
    """
    return config_text(config) if export_format == "json" else glsl_constants(config)


def glsl_constants(config: TunedConfig) -> str:
    """Constant declarations, valid in GLSL 3.30 and later and in GLSL ES 3.00.

    ASCII only, because GLSL before 4.20 allows nothing else even in comments; so names stand there,
    and symbols do not.

    Raises:
        InputError: a value is out of range.
    """
    checked = {
        spec.name: spec.checked(value)
        for spec, value in zip(ARTIST_PARAMETERS, config.parameters.as_dict().values(), strict=True)
    }
    lines = ["// Written by `vpltune export --to glsl`. No value has a world unit."]
    lines += [_declaration(spec, checked[spec.name]) for spec in ARTIST_PARAMETERS]
    return "\n".join(lines) + "\n"


def glsl_name(spec: ParameterSpec) -> str:
    """The constant's name: VPL_INTENSITY, VPL_COUNT, …"""
    return f"VPL_{spec.name.removeprefix('vpl_').upper()}"


def _declaration(spec: ParameterSpec, value: float | int) -> str:
    glsl_type = "int" if spec.whole_number else "float"
    # repr of a float always has a point or an exponent, and both forms are GLSL float literals.
    return f"const {glsl_type} {glsl_name(spec)} = {value!r}; // {spec.unit}"
