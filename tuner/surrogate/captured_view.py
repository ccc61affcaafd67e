"""One view as the tuner uses it: the reference, and the buffers that the runtime rendered."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32, Int

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.metrics.radiance import radiance
from vpltune.tuner.metrics.view_metrics import ViewMetrics, view_metrics
from vpltune.tuner.reference.reference_view import ReferenceView

PIXELS_STEP = 512
"""Pixel counts are rounded down to a multiple of this, so that views share compiled functions. A choice: it
drops 256 pixels on average."""
SAME_SURFACE = 0.02
"""Runtime and reference see the same surface if their positions differ by at most this share of the depth. A
choice: rounding is a thousandth of it, and the gap behind a silhouette is mostly larger."""


@dataclass(frozen=True, eq=False)
class CapturedView:
    """A view with its reference, G-buffer and VPLs.

    The VPLs do not depend on the fitted parameters, so one capture is enough for a whole fit.
    """

    view: View
    reference: ReferenceView
    captured: CapturedFrame
    drawn_with: TunedConfig | None = None
    """The config that `captured` was rendered with, a prior replaced by what it set; None if unknown."""
    statistics: Float32[np.ndarray, " statistics"] | None = None
    """The scene statistics of the view (`renderer.config.scene_statistics`); None if not measured."""
    valid: Bool[np.ndarray, "height width"] = field(init=False)
    """Whether runtime and reference see the same surface. At silhouettes they may differ."""

    def __post_init__(self) -> None:
        apart = np.linalg.norm(self.captured.position_world - self.reference.position_world, axis=-1)
        same = apart <= SAME_SURFACE * self.captured.depth
        object.__setattr__(self, "valid", self.captured.valid & self.reference.valid & same)

    @property
    def lit(self) -> bool:
        """Whether the reference has any indirect light. Without it, relative errors are undefined."""
        return bool(self.reference.irradiance[self.valid].any())

    @property
    def disagreement(self) -> float:
        """Share of the pixels with a surface where runtime and reference see different ones, in [0, 1]."""
        seen = self.captured.valid | self.reference.valid
        return float((seen & ~self.valid).sum() / seen.sum()) if seen.any() else 0.0

    def usable_pixels(self) -> np.ndarray:
        """The pixels of `valid`, as indices into the valid pixels of the captured frame."""
        return np.flatnonzero(self.valid.ravel()[self.captured.valid.ravel()])

    def fitted_pixels(self, limit: int, seed: int) -> np.ndarray:
        """At most `limit` random pixels of `valid`, as indices into the valid pixels of the captured frame.

        Their number is a multiple of `PIXELS_STEP`, so that views share compiled functions. If there are
        fewer than `PIXELS_STEP`, all are returned. The indices are distinct and sorted.
        """
        usable = self.usable_pixels()
        count = min(len(usable), limit)
        count = count // PIXELS_STEP * PIXELS_STEP if count >= PIXELS_STEP else count
        if len(usable) == count:
            return usable
        return np.sort(np.random.default_rng(seed).choice(usable, count, replace=False))

    def pixel_values(self, limit: int, seed: int) -> "PixelValues":
        """What is known at the pixels of `fitted_pixels`."""
        chosen = self.fitted_pixels(limit, seed)
        flat = np.flatnonzero(self.captured.valid.ravel())[chosen]
        reference = self.reference
        images = (
            reference.irradiance,
            reference.direct_irradiance,
            self.captured.indirect_irradiance,
            reference.irradiance_a,
            reference.irradiance_b,
        )
        return PixelValues(chosen, flat, *(image.reshape(-1, 3)[flat] for image in images))

    def reference_radiance(self) -> Float32[np.ndarray, "height width 3"]:
        """Direct plus indirect radiance of the reference [W/(m²·sr)]."""
        reference = self.reference
        return radiance(reference.albedo, reference.direct_irradiance, reference.irradiance)

    def runtime_radiance(
        self, indirect_irradiance: Float32[np.ndarray, "height width 3"]
    ) -> Float32[np.ndarray, "height width 3"]:
        """Radiance [W/(m²·sr)] from the runtime's albedo and direct light and this indirect light [W/m²]."""
        return radiance(self.captured.albedo, self.captured.direct_irradiance, indirect_irradiance)

    def metrics(self, indirect_irradiance: Float32[np.ndarray, "height width 3"]) -> ViewMetrics:
        """Error metrics of an image with this indirect irradiance [W/m²], over the pixels of `valid`.

        FLIP compares the light: both images have the runtime's albedo, so that texture filtering does not
        count.
        """
        reference = self.reference
        light = radiance(self.captured.albedo, reference.direct_irradiance, reference.irradiance)
        same = self.valid[..., None]
        return view_metrics(
            indirect_irradiance,
            reference.irradiance,
            self.runtime_radiance(indirect_irradiance) * same,
            light * same,
            self.valid,
        )


@dataclass(frozen=True, eq=False)
class PixelValues:
    """Irradiance [W/m²] at some pixels of a view: the reference's and the runtime's."""

    chosen: Int[np.ndarray, " pixels"]
    """Indices into the captured frame's valid pixels."""
    flat: Int[np.ndarray, " pixels"]
    """Indices into the image, row by row."""
    reference: Float32[np.ndarray, "pixels 3"]
    """Indirect irradiance of the reference."""
    direct: Float32[np.ndarray, "pixels 3"]
    """Direct irradiance of the reference."""
    drawn: Float32[np.ndarray, "pixels 3"]
    """Indirect irradiance of the image that the view was captured with."""
    half_a: Float32[np.ndarray, "pixels 3"]
    half_b: Float32[np.ndarray, "pixels 3"]
    """The reference's two independent halves."""


def capture_views(
    runtime: Runtime,
    config: TunedConfig,
    views: tuple[View, ...],
    references: tuple[ReferenceView, ...],
    *,
    statistics: bool = False,
    maps: bool = True,
) -> tuple[CapturedView, ...]:
    """Render every view and read back its buffers, with its `statistics` and visibility `maps` if asked."""
    captured = []
    for view, reference in zip(views, references, strict=True):
        drawn = runtime.draw(view, config)
        frame = drawn.capture(maps=maps)
        measured = drawn.read_statistics() if statistics else None
        drawn_with = config.with_parameters(drawn.read_parameters())
        captured.append(CapturedView(view, reference, frame, drawn_with, measured))
    return tuple(captured)


def runtime_irradiance(
    runtime: Runtime,
    config: TunedConfig,
    view: CapturedView,
    known: Sequence[CapturedView] = (),
) -> Float32[np.ndarray, "height width 3"]:
    """The indirect irradiance [W/m²] that the runtime renders for a view with `config`.

    It is taken from `view` or `known` if one of them was rendered with the same settings.
    """
    for each in (view, *known):
        if each.drawn_with is not None and each.drawn_with.draws_as(config) and each.view is view.view:
            return each.captured.indirect_irradiance
    return runtime.render(view.view, config, layer="irradiance")
