"""Makes the three scenes that ship with VPLtune, the same bytes on every run.

    python configs/scenes/make_scenes.py [--into FOLDER]

| file | size | light | what it is for |
|---|---|---|---|
| cornell-box.glb | 0.1 m | spot | the published box: colour bleeding, two occluders |
| gallery.glb | 5 m | spot | a closed room with a partition: light that must go round a corner |
| courtyard.glb | 50 m | directional | open to the sky: a colonnade of occluders, sunlit coloured walls |

Lengths are metres. Light intensities are W/sr and W/m² (glTF's candela and lux, one to one).
"""

import argparse
import math
from pathlib import Path

import numpy as np
from cornell_reflectance import GREEN, RED, WHITE, linear_rgb
from glb_writer import GlbWriter, Shape, box, cylinder, joined, quad, sphere

COPYRIGHT = "The VPLtune authors; same licence as VPLtune"

# Published millimetres to metres, then 0.18 of the true size: 100.7 mm deep where the true box is 559.2 mm.
CORNELL_SCALE = 0.18 * 0.001


def cornell_box() -> bytes:
    """The Cornell box: positions, camera and spectra of "Cornell Box Data" (Cornell University, 1998).

    Its area light has no counterpart among punctual lights; a spot takes its place, at its centre, 8 mm
    (published) below the ceiling. The box is open towards the camera, as published.
    """
    glb = GlbWriter(COPYRIGHT)
    white = glb.material("white", linear_rgb(WHITE))
    green = glb.material("green", linear_rgb(GREEN))
    red = glb.material("red", linear_rgb(RED))
    middle = (278.0, 274.0, 280.0)
    walls = {
        "floor": ([(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)], white),
        "ceiling": ([(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)], white),
        "back wall": ([(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)], white),
        "right wall": ([(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)], green),
        "left wall": ([(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)], red),
    }
    blocks = {
        "short block": ([(130, 65), (82, 225), (240, 272), (290, 114)], 165.0),
        "tall block": ([(423, 247), (265, 296), (314, 456), (472, 406)], 330.0),
    }
    parts = [(name, quad(corners, middle), material) for name, (corners, material) in walls.items()]
    parts += [(name, _block(rim, height), white) for name, (rim, height) in blocks.items()]
    nodes = []
    for name, shape, material in parts:
        shape.positions = shape.positions * CORNELL_SCALE
        nodes.append(glb.node(name, mesh=glb.mesh(name, shape, material)))
    # A 25 mm film behind a 35 mm lens.
    yfov = round(2.0 * math.atan(0.025 / (2.0 * 0.035)), 9)
    eye, target = (278.0, 273.0, -800.0), (278.0, 273.0, 0.0)
    nodes.append(glb.camera(_scaled(eye), _scaled(target), yfov, 559.2 * CORNELL_SCALE))
    lamp = (278.0, 540.8, 279.5)
    floor_distance = lamp[1] * CORNELL_SCALE
    nodes.append(
        glb.light(
            # π W/m² on the floor below.
            _spot("ceiling spot", math.pi * floor_distance**2, 45.0, 65.0),
            _scaled(lamp),
            _scaled((278.0, 0.0, 279.5)),
        )
    )
    return glb.bytes(nodes)


def _scaled(point: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (coordinate * CORNELL_SCALE for coordinate in point)
    return x, y, z


def _block(rim: list[tuple[float, float]], height: float) -> Shape:
    """Top and four sides over a footprint of (x, z) corners; no bottom, as published."""
    center = np.append(np.mean(rim, axis=0), 0.5 * height)[[0, 2, 1]]
    outlines = [[(x, height, z) for x, z in rim]]
    for (x0, z0), (x1, z1) in zip(rim, rim[1:] + rim[:1], strict=True):
        outlines.append([(x0, 0.0, z0), (x0, height, z0), (x1, height, z1), (x1, 0.0, z1)])
    return joined([quad(corners, tuple(2.0 * np.mean(corners, axis=0) - center)) for corners in outlines])


def _spot(name: str, intensity: float, inner_degrees: float, outer_degrees: float) -> dict:
    cone = {
        "innerConeAngle": round(math.radians(inner_degrees), 9),
        "outerConeAngle": round(math.radians(outer_degrees), 9),
    }
    return {
        "name": name,
        "type": "spot",
        "color": [1.0, 1.0, 1.0],
        "intensity": round(intensity, 9),
        "spot": cone,
    }


def gallery() -> bytes:
    """A closed room, 5 × 2.8 × 4.4 m, with a doorway in a partition; the room behind it gets no direct light.

    Parts that meet a wall reach a little way into it, so that no two faces share a plane.
    """
    glb = GlbWriter(COPYRIGHT)
    plaster = glb.material("plaster", (0.76, 0.74, 0.70))
    terracotta = glb.material("terracotta", (0.66, 0.19, 0.09))
    blue = glb.material("blue", (0.12, 0.24, 0.62))
    boards = glb.material("floor boards", (0.46, 0.31, 0.19))
    oak = glb.material("oak", (0.55, 0.38, 0.20))
    green = glb.material("green", (0.20, 0.50, 0.22))
    painting = glb.material(
        "painting", (0.85, 0.85, 0.85), glb.texture("painting", _painting()), (2.0, 1.0), (0.25, 0.0)
    )
    tinted = glb.material("vertex coloured", (0.82, 0.82, 0.82))
    nodes = []

    def place(name: str, shape: Shape, material: int, **properties: object) -> None:
        nodes.append(glb.node(name, mesh=glb.mesh(name, shape, material), **properties))

    shell = box((0.0, 0.0, 0.0), (5.0, 2.8, 4.4), inward=True)
    for name, face, material in zip(
        ("left wall", "right wall", "floor", "ceiling", "back wall", "front wall"),
        shell,
        (terracotta, blue, boards, plaster, plaster, plaster),
        strict=True,
    ):
        place(name, face, material)
    # One outline, so that the jambs, the lintel and the faces are a single closed solid.
    place(
        "partition",
        _doorway(x=(3.2, 3.35), z=(-0.05, 4.45), top=2.85, opening=(1.5, 2.5), height=2.1),
        plaster,
    )
    place("screen", joined(box((4.1, -0.02, 0.9), (4.2, 1.7, 2.1))), green)
    top = box((-0.7, 0.72, -0.4), (0.7, 0.76, 0.4))
    legs = [
        face
        for x in (-0.62, 0.56)
        for z in (-0.32, 0.26)
        for face in box((x, -0.02, z), (x + 0.06, 0.74, z + 0.06))
    ]
    place("table", joined(top + legs), oak, translation=[1.9, 0.0, 1.2])
    place("pedestal", joined(box((0.45, -0.02, 0.5), (0.85, 0.95, 0.9))), plaster)
    ball = sphere(0.22, 16, 24)
    # From magenta below to yellow above; vertex colours multiply the base colour.
    mix = 0.5 + 0.5 * ball.normals[:, 1:2]
    ball.colors = (1.0 - mix) * np.array([0.75, 0.10, 0.55]) + mix * np.array([0.95, 0.85, 0.15])
    place("ball", ball, tinted, translation=[0.65, 1.16, 0.7])
    panel = box((1.3, 1.1, -0.02), (2.7, 2.0, 0.03))
    place("painting", joined(panel), painting)
    nodes.append(glb.camera((0.35, 1.6, 4.1), (1.87, 1.1, 1.5), round(math.radians(65.0), 9), 5.0))
    # Towards the far corner, away from the doorway: what lies behind that is lit by bounces alone.
    nodes.append(glb.light(_spot("ceiling spot", 14.0, 35.0, 55.0), (1.9, 2.6, 2.4), (0.5, 0.3, 0.9)))
    return glb.bytes(nodes)


def _doorway(
    x: tuple[float, float], z: tuple[float, float], top: float, opening: tuple[float, float], height: float
) -> Shape:
    """A wall between two planes of x with a doorway cut through it: one closed solid."""
    bottom = -0.05
    outline = [
        (bottom, z[0]),
        (top, z[0]),
        (top, z[1]),
        (bottom, z[1]),
        (bottom, opening[1]),
        (height, opening[1]),
        (height, opening[0]),
        (bottom, opening[0]),
    ]
    pieces = (
        [(bottom, z[0]), (height, z[0]), (height, opening[0]), (bottom, opening[0])],
        [(bottom, opening[1]), (height, opening[1]), (height, z[1]), (bottom, z[1])],
        [(height, z[0]), (top, z[0]), (top, opening[0]), (height, opening[0])],
        [(height, opening[0]), (top, opening[0]), (top, opening[1]), (height, opening[1])],
        [(height, opening[1]), (top, opening[1]), (top, z[1]), (height, z[1])],
    )
    middle = 0.5 * (x[0] + x[1])
    shapes = []
    for plane in x:
        for piece in pieces:
            corners = [(plane, y, depth) for y, depth in piece]
            center = np.mean(corners, axis=0)
            shapes.append(quad(corners, (2.0 * plane - middle, center[1], center[2])))
    for (y0, z0), (y1, z1) in zip(outline, outline[1:] + outline[:1], strict=True):
        # The outline runs so that (Δz, −Δy) in (y, z) points outside.
        center = np.array([middle, 0.5 * (y0 + y1) + (z1 - z0), 0.5 * (z0 + z1) - (y1 - y0)])
        shapes.append(quad([(x[0], y0, z0), (x[1], y0, z0), (x[1], y1, z1), (x[0], y1, z1)], tuple(center)))
    return joined(shapes)


def _painting() -> np.ndarray:
    """16 × 16 texels, sRGB: four flat fields and a dark cross."""
    texels = np.empty((16, 16, 3), np.uint8)
    texels[:8, :8], texels[:8, 8:] = (214, 170, 60), (70, 120, 170)
    texels[8:, :8], texels[8:, 8:] = (160, 60, 70), (215, 210, 190)
    texels[7:9], texels[:, 7:9] = (40, 36, 34), (40, 36, 34)
    return texels


def courtyard() -> bytes:
    """A court, 50 × 9 × 36 m, open to the sky, with a colonnade on two sides and a statue in a basin.

    Walls differ in height and reach into one another and into the ground, so that no two faces share a plane.
    """
    glb = GlbWriter(COPYRIGHT)
    paving = glb.material("paving", (0.58, 0.53, 0.45))
    stone = glb.material("stone", (0.72, 0.70, 0.66))
    red = glb.material("red plaster", (0.63, 0.20, 0.13))
    yellow = glb.material("yellow plaster", (0.72, 0.55, 0.20))
    blue = glb.material("blue plaster", (0.20, 0.32, 0.58))
    bronze = glb.material("bronze", (0.24, 0.33, 0.25))
    nodes = []

    def place(name: str, shapes: list[Shape], material: int) -> None:
        nodes.append(glb.node(name, mesh=glb.mesh(name, joined(shapes), material)))

    place("ground", box((-26.5, -1.0, -19.5), (26.5, 0.0, 19.5)), paving)
    place("left wall", box((-26.0, -0.5, -19.0), (-25.0, 9.0, 19.0)), red)
    place("right wall", box((25.0, -0.5, -19.0), (26.0, 8.5, 19.0)), blue)
    place("back wall", box((-25.6, -0.6, -19.1), (25.6, 9.5, -18.0)), yellow)
    place("front wall", box((-25.6, -0.6, 18.0), (25.6, 8.0, 19.1)), stone)
    place("back roof", box((-25.4, 6.2, -18.5), (25.4, 6.9, -12.5)), stone)
    place("left roof", box((-25.5, 6.0, -12.6), (-19.5, 6.7, 18.5)), stone)
    pillar = joined([cylinder(0.55, -0.2, 6.3, 20), *box((-0.8, -0.1, -0.8), (0.8, 0.5, 0.8))])
    mesh = glb.mesh("pillar", pillar, stone)
    # The corner pillar carries both roofs; −20.1 and −13.1 leave the roofs 0.6 m of overhang.
    places = [(x, -13.1) for x in (-20.1, -13.6, -7.1, -0.6, 5.9, 12.4, 18.9)]
    places += [(-20.1, z) for z in (-6.9, -0.7, 5.5, 11.7)]
    pillars = [glb.node(f"pillar {i}", mesh=mesh, translation=[x, 0.0, z]) for i, (x, z) in enumerate(places)]
    nodes.append(glb.node("colonnade", children=pillars))
    place("basin", [cylinder(4.0, -0.3, 0.7, 32), cylinder(1.4, 0.6, 2.2, 24)], stone)
    place(
        "statue", [*box((-0.9, 2.1, -0.9), (0.9, 5.2, 0.9)), *box((-0.5, 5.1, -0.5), (0.5, 6.6, 0.5))], bronze
    )
    nodes.append(glb.camera((15.5, 3.4, 11.5), (-11.0, 2.8, -11.0), round(math.radians(55.0), 9), 50.0))
    # Low enough to reach in under the left roof; the back arcade and the foreground stay in shade.
    sun = {"name": "sun", "type": "directional", "color": [1.0, 0.95, 0.86], "intensity": 5.0}
    nodes.append(glb.light(sun, (24.0, 15.0, 3.0), (0.0, 0.0, 0.0)))
    return glb.bytes(nodes)


SCENES = {"cornell-box.glb": cornell_box, "gallery.glb": gallery, "courtyard.glb": courtyard}


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the scenes that ship with VPLtune.")
    parser.add_argument("--into", type=Path, default=Path(__file__).parent, help="folder to write to")
    folder = parser.parse_args().into
    for name, make in SCENES.items():
        data = make()
        (folder / name).write_bytes(data)
        print(f"{folder / name}: {len(data)} bytes")


if __name__ == "__main__":
    main()
