"""Reading a drawn frame back into numpy, row 0 at the top, for the tuner, tests and image files."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt32

from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.visibility_map_layout import TEXEL_BYTES, VISIBILITY_CORNER_MASK
from vpltune.renderer.gpu.octahedral import octahedral_decode
from vpltune.renderer.gpu.resources import HOST_TEXTURE, Access, Resources
from vpltune.renderer.scene.views import View, ray_directions_world


@dataclass(frozen=True, eq=False)
class VisibilityMaps:
    """The surfaces that each VPL sees: a ray for each texel of its hemisphere, a block at a silhouette.

    Texels that no receiver of the frame can look up are not cast, and hold the entry of a ray that met
    nothing. Kept as the GPU packs them, and unpacked when first asked for: of most frames nobody asks.
    """

    texels: UInt32[np.ndarray, "vpls size size 2"]
    """Zero where there is a block."""
    corner: Int32[np.ndarray, "vpls size size"]
    """The corner mark of each texel, 0 for none: shaders/common/vpl_visibility.glsl."""
    block: Int32[np.ndarray, "vpls size size"]
    """Which block of finer texels stands for this one, counted in the order of texels; -1 where none does."""
    details: UInt32[np.ndarray, "blocks refinement refinement 2"]

    @property
    def distance(self) -> Float32[np.ndarray, "vpls size size"]:
        """In units of L; 0 where there is a block."""
        return self._maps[0]

    @property
    def normal(self) -> Float32[np.ndarray, "vpls size size 3"]:
        """Towards the VPL, in its own frame (`hemisphere_frame`)."""
        return self._maps[1]

    @property
    def block_distance(self) -> Float32[np.ndarray, "blocks refinement refinement"]:
        """In units of L."""
        return self._blocks[0]

    @property
    def block_normal(self) -> Float32[np.ndarray, "blocks refinement refinement 3"]:
        """As `normal`."""
        return self._blocks[1]

    @cached_property
    def _maps(self) -> tuple[np.ndarray, np.ndarray]:
        return _met_surfaces(self.texels)

    @cached_property
    def _blocks(self) -> tuple[np.ndarray, np.ndarray]:
        return _met_surfaces(self.details)


@dataclass(frozen=True, eq=False)
class CapturedFrame:
    """What the gather reads and what it makes, for one view; lengths in world units."""

    valid: Bool[np.ndarray, "height width"]
    """False where the camera ray leaves the scene."""
    depth: Float32[np.ndarray, "height width"]
    """Distance along the view axis; 0 where not valid."""
    position_world: Float32[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normal, towards the camera."""
    albedo: Float32[np.ndarray, "height width 3"]
    direct_irradiance: Float32[np.ndarray, "height width 3"]
    vpl_irradiance: Float32[np.ndarray, "height width 3"]
    """From the VPLs alone: what the tuner's surrogate is a twin of."""
    indirect_irradiance: Float32[np.ndarray, "height width 3"]
    """With the screen-space near field, where its strength is not 0."""
    vpl_position_world: Float32[np.ndarray, "vpls 3"]
    vpl_normal_world: Float32[np.ndarray, "vpls 3"]
    vpl_footprint: Float32[np.ndarray, " vpls"]
    """Radius of the disc that the VPL stands for."""
    vpl_flux: Float32[np.ndarray, "vpls 3"]
    """Reflected radiant flux [W]."""
    asked_vpls: int
    """VPLs, from the first on, that the config's VPL count asks for; any others hold later light."""
    vpls_are_discs: bool
    """Whether they shine as discs, and not as points."""
    visibility_maps: VisibilityMaps | None
    """None where the config asks for none."""
    scene_length: float
    """L: flux-weighted RMS distance of the lit RSM texels from their centroid."""


def in_world_units(captured: CapturedFrame, scale: float) -> CapturedFrame:
    """The frame of a scene of which `scale` times the lengths were drawn (`renderer.scene.working_scale`)."""
    if scale == 1.0:
        return captured
    length = np.float32(1.0 / scale)
    return replace(
        captured,
        depth=captured.depth * length,
        position_world=captured.position_world * length,
        vpl_position_world=captured.vpl_position_world * length,
        vpl_footprint=captured.vpl_footprint * length,
        vpl_flux=captured.vpl_flux * length * length,
        scene_length=captured.scene_length / scale,
    )


def capture_frame(frame: Frame, view: View, *, discs: bool, maps: bool = True) -> CapturedFrame:
    """Read back everything that `frame` holds of `view`, which it has just drawn.

    Args:
        discs: whether its VPLs are clustered discs.
        maps: whether to read the visibility maps, which weigh the most.
    """
    resources = frame.resources
    depth_buffer = read_image(resources, "gbuffer_depth")
    valid = depth_buffer > 0.0
    near_plane = np.float32(frame.camera(view).near_plane)
    depth = np.divide(near_plane, depth_buffer, out=np.zeros_like(depth_buffer), where=valid)
    position = view.camera.position_world + ray_directions_world(view) * depth[..., None]
    reflected = frame.setup.pools.reflected
    vpls = np.frombuffer(resources.read("virtual_point_lights"), np.float32).reshape(-1, 12)[:reflected]
    statistics = np.frombuffer(resources.read("frame_statistics"), np.float32)
    return CapturedFrame(
        valid=valid,
        depth=depth,
        position_world=position.astype(np.float32),
        normal_world=octahedral_decode(read_image(resources, "gbuffer_normal")),
        albedo=read_image(resources, "gbuffer_albedo")[..., :3].astype(np.float32),
        direct_irradiance=read_image(resources, "direct_irradiance")[..., :3],
        vpl_irradiance=read_image(resources, "vpl_irradiance")[..., :3],
        indirect_irradiance=read_image(resources, "indirect_irradiance")[..., :3],
        vpl_position_world=vpls[:, 0:3],
        vpl_normal_world=vpls[:, 4:7],
        vpl_footprint=vpls[:, 3],
        vpl_flux=vpls[:, 8:11],
        asked_vpls=frame.setup.pools.asked,
        vpls_are_discs=discs,
        visibility_maps=_visibility_maps(frame) if maps else None,
        scene_length=float(statistics[2]),
    )


def _visibility_maps(frame: Frame) -> VisibilityMaps | None:
    layout, resources = frame.setup.maps, frame.resources
    if not layout.size:
        return None
    texels = np.frombuffer(resources.read("visibility_maps"), np.uint32)
    texels = texels.reshape(-1, layout.size, layout.size, 2)
    refined = texels[..., 0] >> 31 != 0
    # At least one: OpenGL does not read nothing.
    used_bytes = max(1, int(refined.sum())) * layout.refinement**2 * TEXEL_BYTES
    details = np.frombuffer(resources.read("visibility_details", used_bytes), np.uint32)
    details = details.reshape(-1, layout.refinement, layout.refinement, 2)
    # Blocks lie in the order in which the GPU came to them, which is another one each time.
    details = details[texels[refined][:, 1]]
    corner = (texels[..., 0] & np.uint32(VISIBILITY_CORNER_MASK)).astype(np.int32)
    texels = np.where(refined[..., None], np.uint32(0), texels)
    block = np.full(refined.shape, -1, np.int32)
    block[refined] = np.arange(len(details), dtype=np.int32)
    # The last VPLs may lie on glowing surfaces. Their light is direct, and no part of what is captured.
    reflected = frame.setup.pools.reflected
    texels, corner, block = texels[:reflected], corner[:reflected], block[:reflected]
    return VisibilityMaps(texels, corner, block, details[: int((block >= 0).sum())])


def _met_surfaces(
    texels: UInt32[np.ndarray, "*shape 2"],
) -> tuple[Float32[np.ndarray, "*shape"], Float32[np.ndarray, "*shape 3"]]:
    """Distance and normal: `visibility_texel` in shaders/common/vpl_visibility.glsl."""
    packed = np.stack([texels[..., 1] & 0xFFFF, texels[..., 1] >> 16], axis=-1)
    encoded = packed.astype(np.float32) / np.float32(65535.0)
    return texels[..., 0].copy().view(np.float32), octahedral_decode(encoded)


_DTYPES = {"f1": np.uint8, "f2": np.float16, "f4": np.float32, "nu2": np.uint16}


def read_image(resources: Resources, name: str) -> np.ndarray:
    """The texture called `name` as [height, width] or [height, width, channels], row 0 at the top.

    Normalised 16-bit channels come back as float32 in [0, 1], other types as they are stored.
    """
    resources.access((Access(name, HOST_TEXTURE),))
    texture = resources.texture(name)
    values = np.frombuffer(texture.read(alignment=1), _DTYPES[texture.dtype])
    if texture.dtype == "nu2":
        values = values.astype(np.float32) / np.float32(65535.0)
    shape = (texture.height, texture.width)
    values = values.reshape(shape if texture.components == 1 else (*shape, texture.components))
    return np.ascontiguousarray(values[::-1])
