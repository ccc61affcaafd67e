"""Ray-traced visibility between receivers and virtual point lights (VPLs)."""

from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from vpltune.renderer.scene.scene import Scene
from vpltune.tuner.reference.sobol import hashed
from vpltune.tuner.reference.surfaces import OFFSET
from vpltune.tuner.reference.traced_scene import TracedScene, traced_scene

LIFT = 4.0 * OFFSET
"""Offset of both ends from their surfaces, in scene diagonals. A choice: four times the offset of exact hits,
because positions from rasterised buffers lie less exactly on their triangles."""

RAYS_PER_LAUNCH = 2**22
"""Rays in one kernel. A choice: it bounds memory, and the wait until an interrupt takes effect."""


def ray_traced_visibility(
    scene: Scene,
    positions_world: Float[np.ndarray, "receivers 3"],
    normals_world: Float[np.ndarray, "receivers 3"],
    vpl_positions_world: Float[np.ndarray, "vpls 3"],
    vpl_normals_world: Float[np.ndarray, "vpls 3"],
    disc_radii_world: Float[np.ndarray, " vpls"] | None = None,
) -> Bool[np.ndarray, "receivers vpls"]:
    """Whether each receiver sees each VPL: the middle of a disc, or of the part over the receiver's horizon.

    Both ends lie on surfaces, with unit normals on the lit side. If either end is behind the other's tangent
    plane, the pair exchanges no light: it is False and costs no ray. A surface that stops a share of the
    light hides a VPL from that share of the receivers, chosen by a hash of the pair.

    Args:
        scene: what is in the way.
        positions_world: of the receivers.
        normals_world: of the receivers.
        vpl_positions_world: points, or centres of discs.
        vpl_normals_world: of the VPLs.
        disc_radii_world: radii of discs in world units; None for points.

    Raises:
        InputError: the scene has no triangles, or an index in it is out of range.
    """
    traced = traced_scene(scene)
    lift = LIFT * np.array([1.0])
    receivers = traced.triangles.to_unit(positions_world) + lift * normals_world
    vpls = traced.triangles.to_unit(vpl_positions_world) + lift * vpl_normals_world
    w = traced.wavefront
    radii = np.zeros(len(vpls)) if disc_radii_world is None else disc_radii_world / traced.triangles.diagonal
    tables = [
        w.table(a.astype(np.float32)) for a in (receivers, normals_world, vpls, vpl_normals_world, radii)
    ]
    visible = np.zeros((len(receivers), len(vpls)), bool)
    rows = max(1, RAYS_PER_LAUNCH // max(1, len(vpls)))
    for first in range(0, len(receivers) if len(vpls) else 0, rows):
        chunk = visible[first : first + rows]
        pair = w.table(np.array([first, len(vpls)], np.uint32))
        chunk[:] = w.run(partial(_unoccluded, traced, tables, pair, chunk.size)).reshape(chunk.shape)
    return visible


def _unoccluded(traced: TracedScene, tables: list, pair, count: int) -> Bool[np.ndarray, " count"]:
    w = traced.wavefront
    receivers, normals, vpls, vpl_normals, radii = tables
    lane = w.lanes(count)
    # Padding lanes of the last packet look up 0, and an integer division by 0 would kill the process.
    first, row_length = w.take(pair, lane * 0), w.maximum(w.take(pair, lane * 0 + 1), 1)
    receiver, vpl = first + lane // row_length, lane % row_length
    origin = w.take_vector(receivers, receiver)
    # `segment` is not normalised, so the ray ends at max_t = 1.
    segment = w.take_vector(vpls, vpl) - origin
    normal, vpl_normal = w.take_vector(normals, receiver), w.take_vector(vpl_normals, vpl)
    segment = segment + _offset_in_sight(w, normal, vpl_normal, segment, w.take(radii, vpl))
    facing = w.dot(normal, segment) > 0.0
    facing = facing & (w.dot(vpl_normal, segment) < 0.0)
    # Whether one ray of many comes through.
    random = hashed(w, receiver * row_length + vpl, 0)
    return w.to_numpy(facing & (traced.surfaces.passing(origin, segment, 1.0, facing) > random))


def _offset_in_sight(w, normal, vpl_normal, segment, radius):
    """From a disc's centre to the middle of its part in sight [scene diagonals]; 0 if the centre is in sight.

    The horizon cuts the disc's plane at `cut` from the centre. The middle is halfway from there to the rim.
    """
    between = w.dot(normal, vpl_normal)
    # The bound avoids a division by 0 for parallel planes, which no horizon cuts.
    slope = w.sqrt(w.maximum(1.0 - between * between, 1e-12))
    cut = -w.dot(normal, segment) / slope
    along = w.where((cut > 0.0) & (cut < radius), 0.5 * (cut + radius), 0.0)
    return (normal - vpl_normal * between) * (along / slope)
