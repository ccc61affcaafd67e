"""The textures that passes hand to each other."""

import math
from dataclasses import dataclass

import moderngl
import numpy as np

from vpltune.renderer.errors import MachineError
from vpltune.renderer.gpu.gpu_context import check_errors, create_depth_texture


@dataclass(frozen=True)
class GBuffer:
    """What the camera sees. Position is rebuilt from depth.

    depth: float32, near/distance along the axis, 0 where nothing is hit. normal: octahedral, 2×16 bit.
    albedo: half float, alpha 1 where something is hit. emission: float32 radiance; None where nothing glows.

    Albedo could wait for a second look at the materials, a draw of the scene against equal depth. Measured at
    1080p on three scenes (llvmpipe), two draws took 13 to 44 % longer than one with three targets; on a GPU
    the target's 8 bytes a pixel are some 10 µs of bandwidth, less than a draw of the scene.
    """

    depth: moderngl.Texture
    normal: moderngl.Texture
    albedo: moderngl.Texture
    emission: moderngl.Texture | None
    framebuffer: moderngl.Framebuffer


@dataclass(frozen=True)
class ReflectiveShadowMap:
    """What the lights see: an atlas of square tiles, one for each light face.

    depth: float32, reversed; 0 where nothing is hit. normal: geometric, octahedral, 2×16 bit.
    reflectance: half float; albedo times the cone's falloff, a plain ratio.
    """

    depth: moderngl.Texture
    normal: moderngl.Texture
    reflectance: moderngl.Texture
    framebuffer: moderngl.Framebuffer
    resolution: int
    columns: int
    face_count: int

    @property
    def rows(self) -> int:
        """Height of the atlas in texels."""
        return self.depth.height

    def tile(self, face: int) -> tuple[int, int, int, int]:
        """Left, bottom, width and height of a face's tile in texels."""
        left, bottom = face % self.columns * self.resolution, face // self.columns * self.resolution
        return left, bottom, self.resolution, self.resolution

    @property
    def uniforms(self) -> dict[str, object]:
        """What shaders that include `common/rsm.glsl` need to know beside the textures."""
        return {"rsm_columns": self.columns, "rsm_face_count": self.face_count}


def pixel_groups(texture: moderngl.Texture) -> tuple[int, int]:
    """Workgroups of 8×8 invocations that cover a texture."""
    return -(-texture.width // 8), -(-texture.height // 8)


def create_gbuffer(context: moderngl.Context, size: tuple[int, int], *, glows: bool) -> GBuffer:
    """A G-buffer of `size` = (width, height) pixels; `glows` tells whether surfaces emit light.

    Raises:
        MachineError: the GPU cannot hold it.
    """
    depth = create_depth_texture(context, size)
    normal = _nearest(context.texture(size, 2, dtype="nu2"))
    albedo = _nearest(context.texture(size, 4, dtype="f2"))
    # Radiance has no upper bound that half floats hold.
    emission = _nearest(context.texture(size, 4, dtype="f4")) if glows else None
    targets = [normal, albedo] if emission is None else [normal, albedo, emission]
    framebuffer = context.framebuffer(targets, depth)
    check_errors(context, f"a {size[0]}x{size[1]} G-buffer")
    return GBuffer(depth, normal, albedo, emission, framebuffer)


_FACES_OF_A_POINT = 6
"""The faces of a point light make one row, or a part of one."""
GBUFFER_READS = ("gbuffer_depth", "gbuffer_normal")
RSM_READS = ("rsm_depth", "rsm_normal", "rsm_reflectance", "lights", "rsm_faces")
"""What a program declares that includes `common/gbuffer.glsl` or `common/rsm.glsl`."""


def atlas_columns(face_count: int) -> int:
    """Tiles side by side: about as many as there are one above another."""
    about = _FACES_OF_A_POINT * math.ceil(math.sqrt(face_count) / _FACES_OF_A_POINT)
    return max(1, min(face_count, about))


def create_reflective_shadow_map(
    context: moderngl.Context, resolution: int, face_count: int
) -> ReflectiveShadowMap:
    """An RSM atlas with a tile of `resolution`² texels for each of `face_count` faces.

    Raises:
        MachineError: the GPU cannot hold it.
    """
    columns = atlas_columns(face_count)
    rows = max(1, -(-face_count // columns))
    size = (columns * resolution, rows * resolution)
    largest = context.info["GL_MAX_TEXTURE_SIZE"]
    if max(size) > largest:
        raise MachineError(
            f"lights: their {face_count} shadow maps of {resolution}² texels are more than a texture of this "
            f"GPU holds ({largest}²); use fewer lights, or a smaller --rsm-resolution"
        )
    depth = create_depth_texture(context, size)
    normal = _nearest(context.texture(size, 2, dtype="nu2"))
    reflectance = _nearest(context.texture(size, 4, dtype="f2"))
    framebuffer = context.framebuffer([normal, reflectance], depth)
    check_errors(context, f"a {size[0]}x{size[1]} reflective shadow map")
    return ReflectiveShadowMap(depth, normal, reflectance, framebuffer, resolution, columns, face_count)


def create_irradiance_target(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """A float32 RGBA image; alpha is 1 where the camera sees a surface."""
    return _nearest(context.texture(size, 4, dtype="f4"))


def create_direction_target(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """An image of unit vectors in the world: octahedral, 2×16 bit."""
    return _nearest(context.texture(size, 2, dtype="nu2"))


def create_light_accumulation_target(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """A half-float RGBA image of irradiance, in the unit that `DynamicLights.accumulation_unit` states."""
    return _nearest(context.texture(size, 4, dtype="f2"))


EMPTY_DISPATCH = np.array([0, 1, 1, 0], np.uint32).tobytes()
"""The head of a list that an indirect dispatch goes through: no workgroup, and no element."""


def create_pixel_list(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Buffer:
    """A list (`shaders/common/pixel_list.glsl`) with room for every pixel of an image of `size`."""
    return context.buffer(reserve=len(EMPTY_DISPATCH) + 4 * size[0] * size[1])


def create_display_target(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """An 8-bit RGBA image."""
    return _nearest(context.texture(size, 4, dtype="f1"))


def _nearest(texture: moderngl.Texture) -> moderngl.Texture:
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture
