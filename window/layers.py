"""Paints what a pane shows: a config's image or one of its layers, the reference, or the error against it."""

import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.frame.capture import CapturedFrame, read_image
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.layer_display import for_display
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import check_errors
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.views import View
from vpltune.window.disc_layer import discs_on_surfaces
from vpltune.window.map_layer import map_mosaic, rsm_mosaic
from vpltune.window.reference_file import read_reference
from vpltune.window.requests import DrawRequest

Pixels = UInt8[np.ndarray, "height width 3"]

_SHARES = {"direct": (1.0, 0.0), "indirect": (0.0, 1.0)}
"""Weights of direct and indirect light in the layers that are one of them."""


class LayerPainter:
    """Paints requests of all clients with one runtime, and remembers which surfaces each of them sees."""

    def __init__(self, runtime: Runtime):
        self._runtime = runtime
        self._exposures: dict[int, float] = {}
        self._seen: dict[int, tuple[Camera, CapturedFrame]] = {}

    def paint(
        self, request: DrawRequest, view: View, state: ClipState | None
    ) -> tuple[Pixels | None, dict[str, float | int] | None]:
        """The image that a request asks for, and the parameters that a prior set for it.

        The right pane has the exposure of the left one's final image, so that brightness can be compared.

        Args:
            request: what to paint.
            view: the request's view, with the lights as they are now.
            state: of the client's clip; None paints a still.

        Returns:
            No image where there is no reference yet; no parameters without a prior.
        """
        if request.source in ("reference", "signed_error", "flip"):
            return self._of_reference(request, view), None
        # The left pane measures its exposure anew in each image, as `vpltune render` does.
        exposure = self._exposures.get(request.client) if request.pane == "b" else None
        drawn = self._runtime.draw(view, request.config, state, exposure=exposure)
        captured = drawn.capture(maps=request.layer == "maps")
        self._seen[request.client] = (view.camera, captured)
        if request.pane == "a":
            self._exposures[request.client] = drawn.read_exposure()
        pixels = self._layer(request, view, drawn, captured, exposure)
        prior = None if request.config.auto is None else drawn.read_parameters().as_dict()
        return pixels, prior

    def seen_by(self, client: int, camera: Camera) -> CapturedFrame | None:
        """The surfaces that a client saw last; None if it has not seen any from this camera."""
        if client not in self._seen:
            return None
        then, captured = self._seen[client]
        # 1e-6: a camera that came back from the page as text.
        moved = np.abs(then.to_world - camera.to_world).max()
        return captured if moved <= 1e-6 * max(1.0, float(np.abs(then.to_world).max())) else None

    def _layer(
        self,
        request: DrawRequest,
        view: View,
        drawn: DrawnFrame,
        captured: CapturedFrame,
        exposure: float | None,
    ) -> Pixels:
        layer, resources = request.layer, drawn.frame.resources
        if layer in ("final", "discs"):
            shown = np.ascontiguousarray(read_image(resources, "display")[..., :3])
            check_errors(self._runtime.context, f"layer {layer}")
            return shown if layer == "final" else discs_on_surfaces(captured, view, shown)
        if layer == "rsm":
            return rsm_mosaic(read_image(resources, "rsm_reflectance")[..., :3], view.size)
        if layer == "maps":
            return map_mosaic(captured.visibility_maps, view.size)
        if layer in _SHARES:
            drawn.frame.resolve(_SHARES[layer], 1.0)
            image = read_image(resources, "radiance")[..., :3]
        else:
            image = {
                "irradiance": captured.indirect_irradiance,
                "albedo": captured.albedo,
                "normal": captured.normal_world * captured.valid[..., None],
                "depth": captured.depth,
            }[layer]
        return as_bytes(for_display(self._runtime, layer, image, exposure))

    def _of_reference(self, request: DrawRequest, view: View) -> Pixels | None:
        """The reference, or the error against it, scaled up where it is still coarse."""
        if request.reference is None:
            return None
        reference = read_reference(request.reference)
        exposure = self._exposures.get(request.client)
        if request.source == "reference":
            light = reference.direct_irradiance + reference.irradiance
            radiance = (reference.albedo / np.float32(np.pi) * light).astype(np.float32)
            return enlarged(self._runtime.display(radiance, exposure), view.size)
        # Needs the tuner's packages, as whatever made the reference does.
        from vpltune.window.error_layer import error_pixels

        height, width = reference.valid.shape
        return enlarged(
            error_pixels(self._runtime, request.config, view, (width, height), reference, request.source),
            view.size,
        )


def as_bytes(image: np.ndarray) -> Pixels:
    """An image of bytes as it is, or one of floats in [0, 1] as bytes."""
    if image.dtype == np.uint8:
        return image
    return np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)


def enlarged(image: Pixels, size: tuple[int, int]) -> Pixels:
    """The image at `size`, width and height, by repeating pixels."""
    height, width = image.shape[:2]
    rows = np.arange(size[1]) * height // size[1]
    columns = np.arange(size[0]) * width // size[0]
    return np.ascontiguousarray(image[rows][:, columns])
