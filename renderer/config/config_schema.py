"""The JSON Schema of a config file, made from the parameter table."""

from typing import Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ParameterSpec
from vpltune.renderer.config.auto_prior import auto_schema
from vpltune.renderer.config.light_settings import light_schema
from vpltune.renderer.config.quality import quality_schema
from vpltune.renderer.config.tuned_config import (
    DEFAULT_VISIBILITY,
    FORMAT,
    LARGEST_NUMBER,
    VERSION,
    VISIBILITIES,
)


def config_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a config of the present version."""
    specs = {spec.name: _parameter(spec) for spec in ARTIST_PARAMETERS if spec.part == "parameters"}
    (iterations,) = (_parameter(spec) for spec in ARTIST_PARAMETERS if spec.part == "quality")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "VPLtune config",
        "description": "Tuned parameters of indirect light; none has a world unit.",
        "type": "object",
        "required": ["format", "version", "parameters"],
        "additionalProperties": False,
        "properties": {
            "format": {"const": FORMAT},
            "version": {"const": VERSION},
            "visibility": {
                "description": "What occludes VPLs.",
                "enum": list(VISIBILITIES),
                "default": DEFAULT_VISIBILITY,
            },
            "quality": quality_schema(iterations),
            "parameters": {
                "type": "object",
                "required": list(specs),
                "additionalProperties": False,
                "properties": specs,
            },
            "auto": auto_schema(),
            "light": light_schema(),
            "fit": {
                "description": "How the fit that wrote the file ended.",
                "type": "object",
                "required": ["status"],
                "additionalProperties": False,
                "properties": {"status": {"type": "string"}, "sentence": {"type": "string"}},
            },
            "provenance": {
                "description": "Where the numbers come from; not acted on.",
                "type": "object",
                "additionalProperties": {
                    "type": ["string", "number"],
                    "minimum": -LARGEST_NUMBER,
                    "maximum": LARGEST_NUMBER,
                    "not": {"type": "number", "exclusiveMaximum": -LARGEST_NUMBER},
                },
            },
            "checksum": {
                "description": "SHA-256 of the rest, sorted keys, no blanks; may be left out.",
                "type": "string",
                "pattern": "^sha256:[0-9a-f]{64}$",
            },
        },
    }


def _parameter(spec: ParameterSpec) -> dict[str, Any]:
    return {
        "title": spec.symbol,
        "description": f"{spec.meaning} [{spec.unit}]",
        "type": "integer" if spec.whole_number else "number",
        "minimum": spec.low,
        "maximum": spec.high,
        # Says `minimum` once more, the other way round. NaN is no JSON, but parsers let it pass, and every
        # comparison with it is false: turned round, it fails.
        "not": {"exclusiveMaximum": spec.low},
        "default": spec.default,
    }
