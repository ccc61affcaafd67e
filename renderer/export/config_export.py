"""A tuned config as another program takes it: JSON, constants for a shader, a C header, bytes of a block."""

from collections.abc import Callable
from typing import Literal, get_args

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, ParameterSpec
from vpltune.renderer.config.parameter_block import BLOCK_BYTES, BLOCK_FIELDS, pack_parameters
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility, config_text
from vpltune.renderer.errors import InputError

ExportFormat = Literal["json", "glsl", "c", "std140"]
EXPORT_FORMATS: tuple[ExportFormat, ...] = get_args(ExportFormat)

VISIBILITY_CODES: dict[Visibility, int] = {"transmittance": 1, "maps": 2}
"""VPL_VISIBILITY in exported constants; 0 was a mode that is no more."""
_VISIBILITY_TEXT = ", ".join(f"{code} {name}" for name, code in VISIBILITY_CODES.items())


def exported(config: TunedConfig, export_format: ExportFormat) -> bytes:
    """The contents of the exported file.

    Raises:
        InputError: a value is out of range, or the form has no place for a prior.
    """
    if export_format != "json":
        refuse_prior(config, export_format)
    if export_format == "std140":
        return pack_parameters(config.parameters)
    texts: dict[ExportFormat, Callable[[TunedConfig], str]] = {
        "json": config_text,
        "glsl": glsl_constants,
        "c": c_header,
    }
    return texts[export_format](config).encode("ascii")


def refuse_prior(config: TunedConfig, form: str) -> None:
    """Raise InputError where a config has a prior, for forms that hold parameters alone."""
    if config.auto is not None:
        raise InputError(
            f"--to {form}: a config with 'auto' sets its parameters anew in each frame; "
            "fit a scene from it first: vpltune fit SCENE --config auto"
        )


def beyond_constants(config: TunedConfig, form: str) -> tuple[str, ...]:
    """What constants do not say how to draw, a sentence each; empty for a form that is a config."""
    if form == "json" or config.light.bounces == 1:
        return ()
    return (f"the numbers go with {_bounces(config)} of light: a shader that draws one has less light",)


def _bounces(config: TunedConfig) -> str:
    return "all bounces" if config.light.bounces == "all" else f"{config.light.bounces} bounces"


def glsl_constants(config: TunedConfig) -> str:
    """Constant declarations, valid in GLSL 3.30 and later and in GLSL ES 3.00.

    Where VPL_PARAMETER_BLOCK is defined, the same names are members of a uniform block, which the bytes of
    `--to std140` fill: a shader is written once, and tuned live or compiled with its numbers.

    ASCII only, because GLSL before 4.20 allows nothing else even in comments; so names stand there,
    and symbols do not.

    Raises:
        InputError: a value is out of range.
    """
    values = _checked(config)
    lines = [
        "// Written by `vpltune export --to glsl`. No value has a world unit.",
        *(f"// VPL_BOUNCES: {sentence}." for sentence in beyond_constants(config, "glsl")),
        "#ifdef VPL_PARAMETER_BLOCK",
    ]
    lines += ["layout(std140) uniform VplParameters {"]
    lines += [f"    {_glsl_type(spec)} {constant_name(spec)};  // {spec.unit}" for spec in ARTIST_PARAMETERS]
    lines += ["};", "#else"]
    # repr of a float always has a point or an exponent, and both forms are GLSL float literals.
    lines += [
        f"const {_glsl_type(spec)} {constant_name(spec)} = {values[spec.name]!r}; // {spec.unit}"
        for spec in ARTIST_PARAMETERS
    ]
    visibility = VISIBILITY_CODES[config.visibility]
    lines += ["#endif", f"const int VPL_VISIBILITY = {visibility}; // {_VISIBILITY_TEXT}"]
    lines += [f"const int {name} = {value};" for name, value in _quality_constants(config).items()]
    return "\n".join(lines) + "\n"


def c_header(config: TunedConfig) -> str:
    """A C99 and C++ header: each value as a macro with all its digits, and as a struct laid out as the block.

    Raises:
        InputError: a value is out of range.
    """
    values = _checked(config)
    padding = BLOCK_BYTES // 4 - len(BLOCK_FIELDS)
    macros = [
        f"#define {constant_name(spec)} {values[spec.name]!r} /* {spec.unit} */" for spec in ARTIST_PARAMETERS
    ]
    members = [
        f"    {'int32_t' if spec.whole_number else 'float'} {spec.name}; /* {spec.unit} */"
        for spec in ARTIST_PARAMETERS
    ]
    members += [f"    float padding[{padding}];"] * (padding > 0)
    initial = [
        f"    {constant_name(spec) if spec.whole_number else f'(float){constant_name(spec)}'},"
        for spec in ARTIST_PARAMETERS
    ]
    return "\n".join(
        [
            "/* Written by `vpltune export --to c`. No value has a world unit. */",
            *(f"/* VPL_BOUNCES: {sentence}. */" for sentence in beyond_constants(config, "c")),
            "#ifndef VPLTUNE_PARAMETERS_H",
            "#define VPLTUNE_PARAMETERS_H",
            "#include <stdint.h>",
            *macros,
            f"#define VPL_VISIBILITY {VISIBILITY_CODES[config.visibility]} /* {_VISIBILITY_TEXT} */",
            *(f"#define {name} {value}" for name, value in _quality_constants(config).items()),
            "/* Byte for byte the std140 uniform block of `vpltune export --to std140`. */",
            "struct vpl_parameters {",
            *members,
            "};",
            "static const struct vpl_parameters vpl_parameters = {",
            *initial,
            *["    {0}"] * (padding > 0),
            "};",
            "#endif",
            "",
        ]
    )


def constant_name(spec: ParameterSpec) -> str:
    """The constant's name in GLSL and C: VPL_INTENSITY, VPL_COUNT, …"""
    return f"VPL_{spec.name.removeprefix('vpl_').upper()}"


def _checked(config: TunedConfig) -> dict[str, float | int]:
    return ArtistParameters.validated(config.parameters.as_dict()).as_dict()


def _glsl_type(spec: ParameterSpec) -> str:
    return "int" if spec.whole_number else "float"


def _quality_constants(config: TunedConfig) -> dict[str, int]:
    """The settings that another engine can follow; 0 leaves interleaving or resolution to it, and stands for
    all bounces."""
    quality = config.quality
    return {
        "VPL_BOUNCES": config.light.most_bounces or 0,
        "VPL_INTERLEAVE": 0 if quality.interleave == "auto" else quality.interleave,
        "VPL_MAP_SIZE": quality.map_size,
        "VPL_MAP_REFINEMENT": quality.map_refinement,
        "VPL_RSM_RESOLUTION": quality.rsm_resolution or 0,
    }
