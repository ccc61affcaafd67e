"""Renders a scene that VPLtune exported, without VPLtune: python standalone_reader.py BUNDLE OUT.png

BUNDLE: `vpltune export tuned.json --to bundle --scene scene.glb -o BUNDLE`. VPLs: standalone_vpls.py.
Shaders: standalone_*.glsl. tests/renderer/export/test_standalone_reader.py compares with the runtime.
"""

import json
import sys
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image
from standalone_vpls import virtual_point_lights

PARTS = ("visibility", "disc", "reader")  # standalone_<part>.glsl, one after another


def shader(stage, numbers=()):
    defines = [f"#define {name} {value}" for name, value in [(stage, 1), *numbers]]
    files = [Path(__file__).with_name(f"standalone_{part}.glsl") for part in PARTS]
    return "\n".join(["#version 430", *defines, *(file.read_text(encoding="utf-8") for file in files)])


class Surfaces:  # the bundle's triangles and textures, and a pass that draws them
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
        """Draw from a camera or light. Textures: position and depth, normal (and area), albedo (or flux)."""
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


def light_maps(surfaces, rsm):  # the atlas: position, depth, triangle's normal, area, flux, 1
    atlas, size = np.zeros((*rsm["atlas"], 12)), rsm["resolution"]
    for face, finer in zip(rsm["faces"], [*rsm["faces"][1:], {"light": -1}], strict=True):
        to_world, (row, column) = np.array(face["light_to_world"]), face["origin"]
        maps = surfaces.seen((size, size), to_world, face["extent"], face["light"], face["orthographic"])
        tile = np.dstack([pixels(texture) for texture in maps])
        if face["orthographic"] and finer["light"] == face["light"]:  # nested in it: carries the flux there
            to_finer = np.array(finer["light_to_world"])
            place = (tile[..., :3] - to_finer[:3, 3]) @ to_finer[:3, :2]
            tile[(np.abs(place) < finer["extent"]).all(-1), 8:11] = 0.0
        atlas[row : row + size, column : column + size] = tile
    return atlas


def displayed(radiance, key):
    """8-bit sRGB: mean luminance exposed to `key`, Khronos PBR Neutral tone curve; top row first."""
    luminance = (radiance[..., :3] @ [0.2126, 0.7152, 0.0722]).sum()
    exposure = key * radiance[..., 3].sum() / max(luminance, 1e-30)
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
    images = surfaces.seen(size, camera, view["tan_half_fov"])
    vpls, length = virtual_point_lights(atlas, np.dstack([pixels(one) for one in images]), bundle)
    for binding, content in ((4, vpls), (5, bytes(16 * max(maps["map_room"], 1))), (6, bytes(4))):
        context.buffer(content).bind_to_storage_buffer(binding)
    clustered = bundle["clustered_discs"]
    numbers |= {"scene_length": length, "face_size": rsm["resolution"], "disc_lights": clustered["steps"]}
    numbers |= clustered["disc"] | maps
    if maps["map_room"] > 0:
        texels = maps["map_size"] ** 2
        for stage, groups in (("CASTING", maps["map_size"]), ("MARKING", 1), ("REFINING", texels)):
            context.compute_shader(shader(stage, numbers.items())).run(len(vpls), groups)
            context.memory_barrier()
    depths = context.texture(atlas.shape[1::-1], 1, atlas[..., 3].astype("f4").tobytes(), dtype="f4")
    for unit, texture in enumerate([*images, depths]):
        texture.use(unit)
    radiance = context.texture(size, 4, dtype="f4")
    radiance.bind_to_image(0)
    context.compute_shader(shader("LIGHTING", numbers.items())).run(-(-size[0] // 8), -(-size[1] // 8))
    context.memory_barrier()
    Image.fromarray(displayed(pixels(radiance), view["exposure_key"])).save(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
