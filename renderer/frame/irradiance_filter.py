"""The filter that joins what the pixels of a block computed of shares of the light."""

from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, pixel_groups
from vpltune.renderer.gpu.resources import Resources

PLANE_TOLERANCE = 0.5
"""Pixel footprints that a neighbour may stand off a pixel's plane and still be on its surface. With 1, a dark
slot one pixel high over a lamp was as bright as the ceiling."""
NORMAL_COSINE = 0.8
"""Least cosine between the normals of one surface: 37 degrees, wide enough for coarse round meshes."""
LEAST_COSINE = 1e-3
"""Between light and normal: light that grazes a neighbour says little of other normals. Keeps it finite."""
LARGEST_RELIGHTING = 4.0
"""How much brighter than it is a neighbour may stand in for, where it grazes the light that a pixel faces."""
LEAST_VARIANCE = 0.1
"""Between subsets, over the mean squared: what two or three neighbours show can be alike by chance."""
LEAST_ABSENT = 0.1
"""Share of the subsets: where none is absent, light may still change within the window."""
LARGEST_ERROR = 0.09
"""Squared, relative to the mean's square: beyond, a pixel is gathered in full."""


class IrradianceFilter:
    """An image whose pixels have shares of the light → `target`, where neighbours on one surface are joined.

    Args:
        resources: where images are found by name.
        interleave: pixels along the side of a block, even.
        reads: the image, `as interleaved`; with `relight` the direction of its light, `as direction`; with
            `add_base` what to add, `as base`.
        target: name of the image to write.
        relight: whether neighbours count as if they had a pixel's normal.
        refine: whether pixels with too few or too uneven neighbours go into `pixel_list`.
        add_base: whether `base` is added.
        least_share: share of a block's pixels, in [0, 1]. A pixel goes into `pixel_list` too where fewer
            pixels of its window are on its surface.
        largest_error: squared, relative to the mean's square, from which a pixel goes into that list.
    """

    def __init__(
        self,
        resources: Resources,
        interleave: int,
        *,
        reads: tuple[str, ...],
        target: str,
        relight: bool = False,
        refine: bool = False,
        least_share: float = 0.0,
        add_base: bool = False,
        largest_error: float = LARGEST_ERROR,
    ):
        self._groups = pixel_groups(resources.texture(target))
        self._program = ComputeProgram(
            resources,
            "vpl_gather/interleaved_filter",
            {
                "INTERLEAVE": interleave,
                "PLANE_TOLERANCE": PLANE_TOLERANCE,
                "NORMAL_COSINE": NORMAL_COSINE,
                "LEAST_COSINE": LEAST_COSINE,
                "LARGEST_RELIGHTING": LARGEST_RELIGHTING,
                "LEAST_VARIANCE": LEAST_VARIANCE,
                "LEAST_ABSENT": LEAST_ABSENT,
                "LARGEST_ERROR": largest_error,
                "RELIGHT": relight,
                "REFINE": refine,
                "LEAST_SHARE": least_share,
                "ADD_BASE": add_base,
            },
            reads=(*GBUFFER_READS, *reads),
            writes=(f"{target} as irradiance", "pixel_list"),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Filter the image."""
        self._program.dispatch(*self._groups, **inputs.camera.uniforms)
