"""Small scenes built in code, and a plain Mitsuba path tracer to compare the estimator with.

The path tracer shares only the rays through the pixel centres with the estimator. All else is Mitsuba's own:
shapes, `twosided` `diffuse` reflection, textures, emitters and the `path` integrator.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vpltune.renderer.scene.scene import Camera, Instance, Light, Material, Mesh, Scene, Texture
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, ray_directions_world


@pytest.fixture(autouse=True)
def own_cache_folder(tmp_path_factory, monkeypatch):
    """A cache folder of its own for the whole run, so that the variant is probed only once."""
    folder = tmp_path_factory.getbasetemp() / "vpltune-cache"
    monkeypatch.setenv("VPLTUNE_CACHE", str(folder))
    return folder


def quad_mesh(corner, edge_u, edge_v, material=0, name="quad") -> Mesh:
    """A parallelogram with the normal edge_u × edge_v."""
    corner, edge_u, edge_v = (np.array(v, np.float64) for v in (corner, edge_u, edge_v))
    normal = np.cross(edge_u, edge_v)
    normal /= np.linalg.norm(normal)
    return Mesh(
        name=name,
        positions=np.array([corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v], np.float32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        colors=np.ones((4, 3), np.float32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        material=material,
    )


def scene_of(meshes, materials, textures=(), name="scene") -> Scene:
    """A scene with one untransformed instance of each mesh."""
    instances = tuple(Instance(mesh.name, index, np.eye(4)) for index, mesh in enumerate(meshes))
    return Scene(name, tuple(meshes), instances, tuple(materials), tuple(textures))


def gray(reflectance) -> Material:
    return Material("gray", np.full(3, reflectance, np.float32))


def view_of(eye, target, lights, size=(8, 8), yfov=0.7) -> View:
    camera = Camera(look_at(np.array(eye, np.float64), np.array(target, np.float64)), yfov)
    return View("view", "fitted", size, camera, tuple(lights))


def box_room(texture: Texture | None = None) -> Scene:
    """A room of 2 m, open towards +Z, with a red and a green wall and a block turned by 0.3 rad."""
    white = Material("white", np.array([0.73, 0.7, 0.66], np.float32), None if texture is None else 0)
    red = Material("red", np.array([0.65, 0.05, 0.06], np.float32))
    green = Material("green", np.array([0.12, 0.45, 0.15], np.float32))
    walls = [
        quad_mesh([-1, 0, -1], [0, 0, 2], [2, 0, 0], 0, "floor"),
        quad_mesh([-1, 2, -1], [2, 0, 0], [0, 0, 2], 0, "ceiling"),
        quad_mesh([-1, 0, -1], [2, 0, 0], [0, 2, 0], 0, "back"),
        quad_mesh([-1, 0, -1], [0, 2, 0], [0, 0, 2], 1, "left"),
        quad_mesh([1, 0, -1], [0, 0, 2], [0, 2, 0], 2, "right"),
    ]
    block = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            edge_u, edge_v = np.roll(np.eye(3), axis, axis=1)[[1, 2]] * [[1.0], [side]]
            corner = side * np.eye(3)[axis] / 2 - edge_u / 2 - edge_v / 2
            block.append(quad_mesh(corner, edge_u, edge_v, 0, f"block {axis} {side}"))
    room = scene_of(walls + block, (white, red, green), () if texture is None else (texture,), "box room")
    turned = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
    to_world = np.eye(4)
    to_world[:3, :3] = turned * [0.6, 1.2, 0.6]
    to_world[:3, 3] = [-0.3, 0.6, -0.2]
    placed = [i if i.mesh < len(walls) else replace(i, to_world=to_world) for i in room.instances]
    return replace(room, instances=tuple(placed))


def box_room_view(size=(32, 24), lights=None) -> View:
    # Off the axis, so that no pixel centre sees the exact edge between two walls, where either wall is right.
    return view_of((0.03, 1.02, 3.9), (0, 1, 0), lights or (spot(), point(), sun()), size, np.radians(37))


def spot(**changes) -> Light:
    direction = np.array([0.35, -1.0, -0.1])
    light = Light(
        kind="spot",
        intensity=np.array([10.0, 9.0, 8.0]),
        position_world=np.array([0.0, 1.9, 0.2]),
        direction_world=direction / np.linalg.norm(direction),
        inner_cone=0.4,
        outer_cone=1.0,
    )
    return replace(light, **changes)


def point() -> Light:
    return Light("point", np.array([0.6, 0.8, 1.0]), position_world=np.array([0.6, 0.7, 0.5]))


def sun() -> Light:
    direction = np.array([0.5, -0.4, -1.0])
    return Light(
        "directional", np.array([1.0, 1.5, 0.7]), direction_world=direction / np.linalg.norm(direction)
    )


@pytest.fixture(scope="session")
def shapes() -> SimpleNamespace:
    """The functions of this file, for test modules, which cannot import it."""
    functions = (
        quad_mesh,
        scene_of,
        gray,
        view_of,
        box_room,
        box_room_view,
        spot,
        point,
        sun,
        plain_path_trace,
    )
    return SimpleNamespace(**{function.__name__: function for function in functions})


@pytest.fixture
def mitsuba():
    """Mitsuba with its LLVM variant set."""
    from vpltune.tuner.reference.variant import select_variant

    if select_variant().name != "llvm_ad_rgb":
        pytest.skip("needs Mitsuba's llvm_ad_rgb variant")
    import mitsuba

    return mitsuba


def plain_path_trace(mi, scene: Scene, view: View, depth: int, samples: int, seed: int, sky=None):
    """Radiance at the pixel centres by Mitsuba's integrator: mean, and variance of the mean, [h, w, 3].

    `sky` maps unit vectors, [..., 3], to the radiance from there: Mitsuba's own maps are bilinear, with
    texels on the poles, so ours cannot be handed over as they are.
    """
    import drjit as dr

    stock = _stock_scene(mi, scene, view.lights)
    if sky is not None:
        stock["sky"] = _stock_sky(mi, sky)
    stock = mi.load_dict(stock)
    integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 1000})
    width, height = view.size
    directions = ray_directions_world(view).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = mi.Vector3f(np.repeat(directions, samples, axis=0).T.astype(np.float32))
    eye = mi.Point3f(*view.camera.position_world.tolist())
    sampler = mi.load_dict({"type": "independent", "sample_count": samples})
    sampler.seed(seed, width * height * samples)
    rays = mi.RayDifferential3f(mi.Ray3f(eye, directions))
    radiance, _, _ = integrator.sample(stock, sampler, rays, None, dr.full(mi.Bool, True, dr.width(rays)))
    values = np.array(radiance).T.reshape(height, width, samples, 3).astype(np.float64)
    return values.mean(axis=2), values.var(axis=2, ddof=1) / samples


def _stock_scene(mi, scene: Scene, lights) -> dict:
    stock = {"type": "scene"}
    for index, instance in enumerate(scene.instances):
        stock[f"shape {index}"] = _stock_mesh(mi, scene, instance)
    for index, light in enumerate(lights):
        stock[f"light {index}"] = _stock_emitter(mi, light)
    return stock


def _stock_mesh(mi, scene: Scene, instance: Instance):
    mesh = scene.meshes[instance.mesh]
    material = scene.materials[mesh.material]
    reflectance = {"type": "rgb", "value": material.base_color.tolist()}
    if material.texture is not None:
        texture = scene.textures[material.texture]
        encoded = texture.texels_srgb / 255.0
        linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        wraps = {"repeat": "repeat", "mirrored_repeat": "mirror", "clamp_to_edge": "clamp"}
        assert texture.wrap_u == texture.wrap_v, "Mitsuba's bitmaps have one wrap mode for both directions"
        reflectance = {
            "type": "bitmap",
            "bitmap": mi.Bitmap((linear * material.base_color).astype(np.float32)),
            "raw": True,
            "wrap_mode": wraps[texture.wrap_u],
        }
    else:
        assert (mesh.colors == mesh.colors[0]).all(), "the plain scene has no vertex colours"
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    )
    if material.glows:
        assert material.emission_texture is None and not material.emits_both_ways
        radiance = {"type": "rgb", "value": list(material.emission)}
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    stock = mi.Mesh(
        mesh.name,
        len(mesh.positions),
        len(mesh.triangles),
        props=properties,
        has_vertex_normals=True,
        has_vertex_texcoords=True,
    )
    linear = instance.to_world[:3, :3]
    normals = mesh.normals @ np.linalg.inv(linear)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    parameters = mi.traverse(stock)
    parameters["vertex_positions"] = mi.Float(
        (mesh.positions @ linear.T + instance.to_world[:3, 3]).astype(np.float32).ravel()
    )
    parameters["vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())
    parameters["vertex_texcoords"] = mi.Float(mesh.uv.ravel())
    parameters["faces"] = mi.UInt32(mesh.triangles.ravel().astype(np.uint32))
    parameters.update()
    return stock


def _stock_sky(mi, sky) -> dict:
    """Rows from pole to pole, both included, and columns from azimuth 0, from −Z towards +X."""
    height, width = 257, 512
    polar = np.pi * np.arange(height)[:, None] / (height - 1)
    azimuth = 2.0 * np.pi * np.arange(width) / width
    directions = np.stack(
        [
            np.sin(polar) * np.sin(azimuth),
            np.broadcast_to(np.cos(polar), (height, width)),
            -np.sin(polar) * np.cos(azimuth),
        ],
        axis=-1,
    )
    return {"type": "envmap", "bitmap": mi.Bitmap(sky(directions).astype(np.float32))}


def _stock_emitter(mi, light: Light) -> dict:
    intensity = {"type": "rgb", "value": light.intensity.tolist()}
    if light.kind == "directional":
        return {"type": "directional", "direction": light.direction_world.tolist(), "irradiance": intensity}
    if light.kind == "point":
        return {"type": "point", "position": light.position_world.tolist(), "intensity": intensity}
    # Mitsuba's spot falloff is linear in the angle. Push it to the very rim, and put glTF's falloff into the
    # texture of the emitter, which spans ±tan(cutoff) across the beam.
    size = 2048
    across = ((np.arange(size) + 0.5) / size * 2.0 - 1.0) * np.tan(light.outer_cone)
    cosine = 1.0 / np.sqrt(1.0 + across[None, :] ** 2 + across[:, None] ** 2)
    cos_inner, cos_outer = np.cos(light.inner_cone), np.cos(light.outer_cone)
    falloff = np.clip((cosine - cos_outer) / (cos_inner - cos_outer), 0.0, 1.0) ** 2
    image = mi.Bitmap(np.repeat(falloff[..., None], 3, axis=2).astype(np.float32))
    origin = light.position_world
    up = [0.0, 0.0, 1.0] if abs(light.direction_world[2]) < 0.9 else [0.0, 1.0, 0.0]
    degrees = float(np.degrees(light.outer_cone))
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(
            origin.tolist(), (origin + light.direction_world).tolist(), up
        ),
        "intensity": intensity,
        "cutoff_angle": degrees,
        "beam_width": degrees * 0.99999,
        "texture": {"type": "bitmap", "bitmap": image, "raw": True, "wrap_mode": "clamp"},
    }
