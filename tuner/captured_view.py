"""One view as the tuner works on it: its reference, and what the runtime's buffers hold of it."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32

from renderer.artist_parameters import ArtistParameters
from renderer.capture import CapturedFrame
from renderer.runtime import Runtime
from renderer.views import View
from tuner.radiance import radiance
from tuner.reference.reference_view import ReferenceView


@dataclass(frozen=True, eq=False)
class CapturedView:
    """A view with its reference and its G-buffer and VPLs.

    VPLs do not depend on the fitted parameters, so one capture serves the whole fit.
    """

    view: View
    reference: ReferenceView
    captured: CapturedFrame
    drawn_with: ArtistParameters | None = None
    """The parameters that `captured` was drawn with, where they are known."""
    valid: Bool[np.ndarray, "height width"] = field(init=False)
    """Where both runtime and reference see a surface: at silhouettes rasteriser and ray may differ."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "valid", self.captured.valid & self.reference.valid)

    @property
    def lit(self) -> bool:
        """Whether any indirect light reaches it, by the reference; else no error has a measure."""
        return bool(self.reference.irradiance[self.valid].any())

    def fitted_pixels(self, limit: int, seed: int) -> np.ndarray:
        """Indices into the captured frame's valid pixels, at most `limit`, drawn without replacement."""
        usable = np.flatnonzero(self.reference.valid.ravel()[self.captured.valid.ravel()])
        if len(usable) <= limit:
            return usable
        return np.sort(np.random.default_rng(seed).choice(usable, limit, replace=False))

    def reference_radiance(self) -> Float32[np.ndarray, "height width 3"]:
        """Direct plus indirect radiance of the reference, W/(m² sr)."""
        reference = self.reference
        return radiance(reference.albedo, reference.direct_irradiance, reference.irradiance)

    def runtime_radiance(
        self, indirect_irradiance: Float32[np.ndarray, "height width 3"]
    ) -> Float32[np.ndarray, "height width 3"]:
        """The runtime's direct light and albedo with some indirect irradiance, W/(m² sr)."""
        return radiance(self.captured.albedo, self.captured.direct_irradiance, indirect_irradiance)


def capture_views(
    runtime: Runtime, views: tuple[View, ...], references: tuple[ReferenceView, ...]
) -> tuple[CapturedView, ...]:
    """Draw and read back every view."""
    return tuple(
        CapturedView(view, reference, runtime.capture(view), runtime.drawn_parameters())
        for view, reference in zip(views, references, strict=True)
    )


def runtime_irradiance(
    runtime: Runtime, parameters: ArtistParameters, view: CapturedView
) -> Float32[np.ndarray, "height width 3"]:
    """The runtime's own indirect irradiance of a view with `parameters`, drawn unless it already was."""
    if view.drawn_with == parameters:
        return view.captured.indirect_irradiance
    runtime.parameters = parameters
    return runtime.render(view.view, "irradiance")
