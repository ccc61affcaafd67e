"""Ground truth for a fit: direct light and its bounces, path-traced with Mitsuba."""

from typing import TYPE_CHECKING

from vpltune.tuner.reference.reference_view import ReferenceView, noise_floor
from vpltune.tuner.reference.references import reference_views
from vpltune.tuner.reference.variant import MitsubaVariant, describe_variant

if TYPE_CHECKING:
    from vpltune.tuner.reference.visibility import ray_traced_visibility

__all__ = [
    "MitsubaVariant",
    "ReferenceView",
    "describe_variant",
    "noise_floor",
    "ray_traced_visibility",
    "reference_views",
]


def __getattr__(name: str):
    # Imported on first use: `visibility` loads Mitsuba, the modules above do not.
    if name == "ray_traced_visibility":
        from vpltune.tuner.reference.visibility import ray_traced_visibility

        return ray_traced_visibility
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
