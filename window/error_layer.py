"""The sources `signed_error` and `flip`: how far a config's image is from the reference."""

from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA, map_pixels, signed_error
from vpltune.tuner.metrics.radiance import radiance
from vpltune.tuner.metrics.view_metrics import hdr_flip_map
from vpltune.tuner.surrogate.captured_view import SAME_SURFACE
from vpltune.window.reference_file import ReferenceImages


def error_pixels(
    runtime: Runtime,
    config: TunedConfig,
    view: View,
    size: tuple[int, int],
    reference: ReferenceImages,
    source: str,
) -> UInt8[np.ndarray, "height width 3"]:
    """The error of a config's image against a reference of `size`, in the colours of a report.

    Args:
        source: `signed_error` of the indirect irradiance, blue too dark and red too bright, or `flip`, which
            compares whole images with the same albedo.
    """
    captured = runtime.capture(replace(view, size=size), config, maps=False)
    apart = np.linalg.norm(captured.position_world - reference.position_world, axis=-1)
    valid = captured.valid & reference.valid & (apart <= SAME_SURFACE * captured.depth)
    if source == "signed_error":
        signed = signed_error(captured.indirect_irradiance, reference.irradiance, valid)
        return map_pixels(signed, -1.0, 1.0, DIVERGING, valid)
    shown = radiance(captured.albedo, captured.direct_irradiance, captured.indirect_irradiance)
    right = radiance(captured.albedo, reference.direct_irradiance, reference.irradiance)
    same = valid[..., None]
    return map_pixels(hdr_flip_map(shown * same, right * same), 0.0, 1.0, MAGMA, valid)
