"""Brings configs of version 1 forward to version 2.

Version 1 is what VPLtune 0.1 wrote. It is read until VPLtune 1.0, and never written.
"""

from typing import Any

from vpltune.renderer.errors import InputError

OLDER_NAMES = {
    "falloff_transmittance": "extinction_coefficient",
    "density_relaxation": "lloyd_iterations",
}
"""Parameters that version 1 called otherwise, to their names of today."""


_KEYS = ("format", "version", "visibility", "parameters", "auto", "provenance")


def brought_forward(document: dict[str, Any], where: str) -> dict[str, Any]:
    """A document of version 1 as version 2 has it; its values are not checked here.

    The visibility mode "none" is κ = 0. The fit's status stood in `provenance`.

    Raises:
        InputError: an unknown key, or a parameter is missing that version 1 called otherwise.
    """
    for key in document:
        if key not in _KEYS:
            raise InputError(f"{where}: unknown key {key!r:.60}; version 1 knows {', '.join(_KEYS)}")
    forward = {**document, "version": 2}
    parameters = document.get("parameters")
    if isinstance(parameters, dict):
        for older, newer in OLDER_NAMES.items():
            if newer in parameters:
                raise InputError(f"{where}: parameters: unknown key '{newer}'; version 1 calls it '{older}'")
            if older not in parameters:
                raise InputError(f"{where}: parameters: key '{older}' is missing")
        forward["parameters"] = {OLDER_NAMES.get(key, key): value for key, value in parameters.items()}
        iterations = forward["parameters"].pop("lloyd_iterations")
        # What version 1 drew with.
        forward["quality"] = {"lloyd_iterations": iterations, "interleave": 1, "map_size": 24}
        if document.get("visibility") == "none":
            forward["visibility"] = "transmittance"
            forward["parameters"]["extinction_coefficient"] = 0.0
    provenance = document.get("provenance")
    if isinstance(provenance, dict) and _says_how_the_fit_ended(provenance):
        forward["provenance"] = {key: v for key, v in provenance.items() if key not in ("status", "fit")}
        forward["fit"] = {"status": provenance["status"], "sentence": provenance.get("fit", "")}
    return forward


def _says_how_the_fit_ended(provenance: dict[str, Any]) -> bool:
    """As a fit wrote it; anybody else could call a number of their own `status`."""
    return isinstance(provenance.get("status"), str) and isinstance(provenance.get("fit", ""), str)
