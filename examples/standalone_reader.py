"""Draws a scene that VPLtune exported, without VPLtune: python standalone_reader.py BUNDLE OUT.png

BUNDLE: `vpltune export tuned.json --to bundle --scene scene.glb -o BUNDLE`. Shaders: standalone_*.glsl.
"""

import json
import sys
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image


def shader(stage, numbers=()):
    defines = [f"#define {name} {value}" for name, value in [(stage, 1), *numbers]]
    files = [Path(__file__).with_name(f"standalone_{part}.glsl") for part in ("visibility", "reader")]
    return "\n".join(["#version 430", *defines, *(file.read_text(encoding="utf-8") for file in files)])


class Surfaces:  # the triangles and textures of a bundle
    def __init__(self, context, bundle, binary):
        self.context, self.bundle = context, bundle
        self.program = context.program(shader("VERTEX"), shader("FRAGMENT"))
        arrays = bundle["arrays"].items()
        self.part = {name: context.buffer(binary[a["offset"] :][: a["bytes"]]) for name, a in arrays}
        layouts = {"positions": "3f", "normals": "3f", "uv": "2f", "base_colors": "3f"}
        content = [(self.part[name], layout, f"in_{name}") for name, layout in layouts.items()]
        self.vertices = context.vertex_array(self.program, content, index_buffer=self.part["triangles"])
        for binding, name in enumerate(("lights", "faces", "positions", "triangles")):
            self.part[name].bind_to_storage_buffer(binding)
        self.textures = []
        for entry in bundle["textures"]:
            texels = binary[entry["offset"] :][: entry["bytes"]]
            texture = context.texture(entry["size"], 3, texels, alignment=1, internal_format=0x8C41)  # sRGB
            texture.build_mipmaps()
            texture.anisotropy, (texture.repeat_x, texture.repeat_y) = 8.0, entry["repeat"]
            self.textures.append(texture)

    def seen(self, size, to_world, extent, light=-1, orthographic=False):
        """Textures: position and depth, normal (and area), albedo (or flux)."""
        targets = [self.context.texture(size, 4, dtype="f4") for _ in range(3)]
        self.context.framebuffer(targets, self.context.depth_texture(size)).use()
        self.context.clear()
        self.context.enable_only(moderngl.DEPTH_TEST)
        x, y, z, one = np.linalg.inv(to_world)
        clip = np.array([x / extent[0], y / extent[1], 0 * z, one if orthographic else -z], "f4")
        self.program["to_clip"].write(clip.T.tobytes())
        self.program["eye"] = (*to_world[:3, 2], 0.0) if orthographic else (*to_world[:3, 3], 1.0)
        self.program["axis"], self.program["reach"] = tuple(-z), self.bundle["diagonal"]
        self.program["light"], self.program["texel"] = light, 4 * extent[0] * extent[1] / (size[0] * size[1])
        for draw in self.bundle["draws"]:
            self.program["mirrored"] = self.bundle["textures"][draw["texture"]]["mirrored"]
            self.textures[draw["texture"]].use()
            self.vertices.render(vertices=3 * draw["count"], first=3 * draw["first"])
        return targets


def pixels(texture):  # [height, width, 4], bottom row first
    return np.frombuffer(texture.read(), "f4").reshape(texture.height, texture.width, 4)


def light_maps(surfaces, rsm):  # an atlas of position, depth, plane's normal, area, flux, 1
    atlas, size = np.zeros((*rsm["atlas"], 12)), rsm["resolution"]
    for face in rsm["faces"]:
        to_world, (row, column) = np.array(face["light_to_world"]), face["origin"]
        maps = surfaces.seen((size, size), to_world, face["extent"], face["light"], face["orthographic"])
        atlas[row : row + size, column : column + size] = np.dstack([pixels(texture) for texture in maps])
    return atlas


def virtual_point_lights(atlas, bundle):
    """Rows of position, footprint, normal, 0, flux, 0, drawn with chances of flux^gamma; and the length L."""
    rsm, parameters, flux = bundle["rsm"], bundle["config"]["parameters"], atlas[..., 8:11].mean(-1)
    size, filtering, count = rsm["resolution"], rsm["filtering"], parameters["vpl_count"]
    offset = atlas[..., :3] - (flux[..., None] * atlas[..., :3]).sum((0, 1)) / flux.sum()
    length = np.sqrt((flux * (offset**2).sum(-1)).sum() / flux.sum())
    weight = np.where(flux > 0, flux ** parameters["density_exponent"], 0)
    in_row, rows = np.cumsum(weight, axis=1), np.cumsum(weight.sum(1))
    x, y = ((0.5 + np.arange(1, count + 1)[:, None] * bundle["point_table"]["steps"]) % 1).T
    row = np.searchsorted(rows, y * rows[-1], "right")
    column = (in_row[row] <= (x * in_row[row, -1])[:, None]).sum(1)
    # What the inversion leaves over is the place in the texel.
    right = 1 + (x * in_row[row, -1] - in_row[row, column]) / weight[row, column]
    up = 1 + (y * rows[-1] - rows[row]) / in_row[row, -1]
    # Each VPL has the mean light of the texels around its own.
    at = np.stack([row, column], axis=1)
    window = at[:, None] + np.array([*np.ndindex(filtering, filtering)]) - filtering // 2
    around = tuple(np.moveaxis(window % weight.shape, -1, 0))
    lit = (window // size == at[:, None] // size).all(-1) & (flux[around] > 0)
    draws = count * (weight[around] * lit).sum(1)[:, None] / rows[-1]
    near = (atlas[around] * lit[..., None]).sum(1) / draws
    # It slides with that place over the plane of its own texel.
    faces = [rsm["faces"][number] for number in row // size * (weight.shape[1] // size) + column // size]
    to_world, extent = (np.array([face[key] for face in faces]) for key in ("light_to_world", "extent"))
    flat = np.array([[face["orthographic"]] for face in faces])
    place = np.stack([column % size + right, row % size + up], axis=1) * 2 / size - 1
    across = np.einsum("nij,nj->ni", to_world[:, :3, :2], place * extent)
    start, ray = to_world[:, :3, 3] + across * flat, across * ~flat - to_world[:, :3, 2]
    position, normal = atlas[row, column, :3], atlas[row, column, 4:7]
    along = (normal * ray).sum(1, keepdims=True)
    slid = start + ray * ((normal * (position - start)).sum(1, keepdims=True) / along)
    position = np.where(along > -0.02 * np.linalg.norm(ray, axis=1, keepdims=True), position, slid)
    vpls = [position, np.sqrt(near[:, 7:8] / np.pi), normal, 0 * draws, near[:, 8:11], 0 * draws]
    return np.hstack(vpls).astype("f4"), length


def displayed(radiance, key):
    """Exposed to a mean luminance of `key`, Khronos PBR Neutral tone curve, sRGB; top row first."""
    exposure = key * radiance[..., 3].sum() / (radiance[..., :3] @ [0.2126, 0.7152, 0.0722]).sum()
    color = exposure * radiance[::-1, :, :3]
    low = color.min(-1, keepdims=True)
    color -= np.where(low < 0.08, low - 6.25 * low**2, 0.04)
    peak = color.max(-1, keepdims=True)
    shoulder = 1 - 0.24**2 / np.maximum(peak - 0.52, 0.24)
    white = 1 - 1 / (0.15 * (peak - shoulder) + 1)
    bent = color * shoulder / np.maximum(peak, 1e-9) * (1 - white) + shoulder * white
    color = np.clip(np.where(peak < 0.76, color, bent), 0, 1)
    curve = 1.055 * color ** (1 / 2.4) - 0.055
    return np.uint8(255 * np.where(color > 0.0031308, curve, 12.92 * color) + 0.5)


def main(folder, output):
    bundle = json.loads((Path(folder) / "bundle.json").read_text(encoding="utf-8"))
    view, rsm, numbers = bundle["view"], bundle["rsm"], bundle["config"]["parameters"]
    size, camera, maps = view["size"], np.array(view["camera_to_world"]), bundle["visibility_maps"]
    context = moderngl.create_standalone_context(require=430, backend="egl")
    surfaces = Surfaces(context, bundle, (Path(folder) / "bundle.bin").read_bytes())
    atlas = light_maps(surfaces, rsm)
    vpls, length = virtual_point_lights(atlas, bundle)
    for binding, content in ((4, vpls), (5, bytes(16 * max(maps["map_room"], 1))), (6, bytes(4))):
        context.buffer(content).bind_to_storage_buffer(binding)
    numbers["falloff_transmittance"] *= bundle["config"]["visibility"] != "none"
    numbers |= {"scene_length": length, "face_size": rsm["resolution"], **maps}
    if maps["map_room"] > 0:
        context.compute_shader(shader("CASTING", numbers.items())).run(len(vpls))
        context.memory_barrier()
    depths = context.texture(atlas.shape[1::-1], 1, atlas[..., 3].astype("f4").tobytes(), dtype="f4")
    for unit, texture in enumerate([*surfaces.seen(size, camera, view["tan_half_fov"]), depths]):
        texture.use(unit)
    radiance = context.texture(size, 4, dtype="f4")
    radiance.bind_to_image(0)
    context.compute_shader(shader("LIGHTING", numbers.items())).run(-(-size[0] // 8), -(-size[1] // 8))
    context.memory_barrier()
    Image.fromarray(displayed(pixels(radiance), view["exposure_key"])).save(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
