"""The runtime's own image in the place of a path tracer's: what planted parameters are recovered from."""

import numpy as np

from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.tuner.reference.reference_view import ReferenceView


def own_reference(captured: CapturedFrame) -> ReferenceView:
    """A reference without noise: both halves are the indirect irradiance that was captured."""
    return ReferenceView(
        irradiance_a=captured.indirect_irradiance,
        irradiance_b=captured.indirect_irradiance,
        direct_irradiance=captured.direct_irradiance,
        albedo=captured.albedo,
        position_world=captured.position_world.astype(np.float64),
        normal_world=captured.normal_world,
        valid=captured.valid,
        samples=1,
    )
