"""Draws the virtual point lights (VPLs) for standalone_reader.py, in numpy.

A VPL is a row: position, footprint, normal, 0, flux, 0. `atlas` holds what the lights see, texel by texel:
position, depth, triangle's normal, area, flux, 1. `seen` holds what the camera sees: position, depth,
normal, 0, albedo, 1.
"""

import numpy as np

DARK = [*np.zeros(6), 1.0, *np.zeros(5)]


def virtual_point_lights(atlas, seen, bundle):
    """The VPLs, and the scene length L: the flux-weighted RMS distance of lit texels from their centroid."""
    flux, position = atlas[..., 8:11].mean(-1), atlas[..., :3]
    if not flux.any():
        return np.tile(DARK, (bundle["config"]["parameters"]["vpl_count"], 1)).astype("f4"), 1.0
    offset = position - (flux[..., None] * position).sum((0, 1)) / flux.sum()
    length = np.sqrt((flux * (offset**2).sum(-1)).sum() / flux.sum())
    parameters, rules = bundle["config"]["parameters"], bundle["clustered_discs"]
    weight = np.where(flux > 0, flux ** parameters["density_exponent"], 0)
    if bundle["vpl_importance"]["cells"] > 0:
        share = parameters["density_importance"]
        least = max(1.0 - share, bundle["vpl_importance"]["least"])
        weight *= share * importance(atlas, seen, bundle) + least
    count = parameters["vpl_count"]
    if rules["steps"] == 0:
        vpls = drawn(atlas, weight, bundle, count)
    else:
        samples = drawn(atlas, weight, bundle, rules["samples"])
        vpls = samples[:count]
        for _ in range(rules["steps"]):
            reaches = rules["normal_reach"], rules["off_plane_factor"], rules["sample_reach"]
            vpls = relaxed(vpls, samples[samples[:, 3] > 0], length, *reaches)
    return vpls.astype("f4"), length


def importance(atlas, seen, bundle):
    """For each texel, how much error the image would have if its light were drawn too seldom; 1 in the mean.

    Importance cells, each summarised from 16 texels, light some points of the image, without visibility. The
    relative error is least if a texel's probability is ∝ flux · sqrt(Σ f² / (E² + bound)), summed over the
    points: f is a point's irradiance per watt from the texel's cell, E that from all cells. Runtime:
    shaders/vpl_importance/vpl_importance.comp.
    """
    rules, size = bundle["vpl_importance"], bundle["rsm"]["resolution"]
    cells, dot = rules["cells"], lambda a, b: (a * b).sum(-1)
    samples = ((np.arange(4 * cells) + 0.5) / (4 * cells) * size).astype(int)
    row, column = (np.add.outer(np.arange(0, side, size), samples).ravel() for side in atlas.shape[:2])
    shape = len(row) // 4, len(column) // 4
    texels = (
        atlas[np.ix_(row, column)].reshape(shape[0], 4, shape[1], 4, 12).swapaxes(1, 2).reshape(-1, 16, 12)
    )
    flux = texels[..., 8:11].mean(-1)
    total = np.maximum(flux.sum(1), 1e-30)[:, None]
    position, normal = ((flux[..., None] * texels[..., i : i + 3]).sum(1) / total for i in (0, 4))
    straight = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(straight, 1e-30)[:, None]
    area = (texels[..., 7] * (flux > 0)).sum(1) * (size / cells / 4) ** 2

    pixels = np.array(seen.shape[1::-1])
    at = (0.5 + np.arange(1, rules["receivers"] + 1)[:, None] * bundle["point_table"]["steps"]) % 1 * pixels
    points = seen[tuple(at.astype(int).T[::-1])]
    points = points[points[:, 11] > 0]
    if not len(points):
        return np.ones(atlas.shape[:2])
    to_cell = position - points[:, None, :3]
    squared = np.maximum(dot(to_cell, to_cell), 1e-30)
    # Below 1e-3 a surface lies in the other's plane, and rounding decides on which side.
    cosines = [dot(points[:, None, 4:7], to_cell), dot(-normal, to_cell)] / np.sqrt(squared) - 1e-3
    # What faces away but lies near counts a little: a roof over a lit floor.
    both = np.maximum(np.prod(np.maximum(cosines, 0), axis=0), 0.01)
    form = both / (np.pi * squared + rules["spread"] * area)
    form *= straight > 1e-4
    received = (form @ total)[:, 0]
    weight = 1 / (received**2 / (rules["dark_share"] * (received**2).mean()) + 1)
    missed = np.sqrt(weight @ form**2)
    mean = (total[:, 0] * missed)[straight > 1e-4].sum() / total[straight > 1e-4].sum()
    share = (missed / mean if mean > 0 else np.ones(len(missed))).reshape(shape)
    row, column = (np.arange(side) * cells // size for side in atlas.shape[:2])
    return share[np.ix_(row, column)]


def drawn(atlas, weight, bundle, count):
    """`count` VPLs, drawn in proportion to `weight`. Runtime: shaders/common/vpl_placement.glsl."""
    rsm, flux = bundle["rsm"], atlas[..., 8:11].mean(-1)
    size, filtering = rsm["resolution"], rsm["filtering"]
    in_row, rows = np.cumsum(weight, axis=1), np.cumsum(weight.sum(1))
    x, y = ((0.5 + np.arange(1, count + 1)[:, None] * bundle["point_table"]["steps"]) % 1).T
    row = np.searchsorted(rows, y * rows[-1], "right")
    column = (in_row[row] <= (x * in_row[row, -1])[:, None]).sum(1)
    # The rest of the table's point after the inversion gives the position inside the texel.
    right = 1 + (x * in_row[row, -1] - in_row[row, column]) / weight[row, column]
    up = 1 + (y * rows[-1] - rows[row]) / in_row[row, -1]
    # Each VPL has the mean flux and area of the texels around its own.
    at = np.stack([row, column], axis=1)
    window = at[:, None] + np.array([*np.ndindex(filtering, filtering)]) - filtering // 2
    around = tuple(np.moveaxis(window % weight.shape, -1, 0))
    lit = (window // size == at[:, None] // size).all(-1) & (flux[around] > 0)
    draws = count * (weight[around] * lit).sum(1)[:, None] / rows[-1]
    near = (atlas[around] * lit[..., None]).sum(1) / draws
    # It slides with the position inside the texel, over the texel's surface, but not over its edge.
    position, normal = atlas[row, column, :3], atlas[row, column, 4:7]
    inside = np.stack([right, up], axis=1)
    for axis in (0, 1):
        beside = at.copy()
        beside[:, 1 - axis] += np.where(inside[:, axis] < 0.5, -1, 1)
        other = atlas[tuple(np.moveaxis(beside % weight.shape, -1, 0))]
        between = other[:, :3] - position
        goes_on = (beside // size == at // size).all(1) & (other[:, 8:11].mean(-1) > 0)
        goes_on &= (other[:, 4:7] * normal).sum(1) > 0.9
        goes_on &= abs((between * normal).sum(1)) < 0.1 * np.linalg.norm(between, axis=1)
        inside[~goes_on, axis] = 0.5
    faces = [rsm["faces"][number] for number in row // size * (weight.shape[1] // size) + column // size]
    to_world, extent = (np.array([face[key] for face in faces]) for key in ("light_to_world", "extent"))
    flat = np.array([[face["orthographic"]] for face in faces])
    place = (np.stack([column, row], axis=1) % size + inside) * 2 / size - 1
    across = np.einsum("nij,nj->ni", to_world[:, :3, :2], place * extent)
    start, ray = to_world[:, :3, 3] + across * flat, across * ~flat - to_world[:, :3, 2]
    along = (normal * ray).sum(1, keepdims=True)
    slid = start + ray * ((normal * (position - start)).sum(1, keepdims=True) / along)
    position = np.where(along > -0.02 * np.linalg.norm(ray, axis=1, keepdims=True), position, slid)
    vpls = [position, np.sqrt(near[:, 7:8] / np.pi), normal, 0 * draws, near[:, 8:11], 0 * draws]
    return np.hstack(vpls)


def relaxed(vpls, samples, length, reach, off_plane_factor, sample_reach):
    """One Lloyd iteration (1982): each VPL moves to the centroid of its nearest samples, with their flux."""
    unit = np.minimum(length, sample_reach * samples[:, 3])

    def far(some, unit, position, normal):  # normals count too: no cluster goes round an edge
        squared = (some[:, :3] ** 2).sum(1)[:, None] - 2 * some[:, :3] @ position.T + (position**2).sum(1)
        return squared / unit[:, None] ** 2 + 2 * reach**2 * (1 - some[:, 4:7] @ normal.T)

    # A disc is flat: offsets from its plane, and from the sample's, count more than those along them.
    above = samples[:, :3] @ vpls[:, 4:7].T - (vpls[:, :3] * vpls[:, 4:7]).sum(1)
    below = (samples[:, :3] * samples[:, 4:7]).sum(1)[:, None] - samples[:, 4:7] @ vpls[:, :3].T
    off_plane = off_plane_factor * np.maximum(abs(above), abs(below)) / unit[:, None]
    away = far(samples, unit, vpls[:, :3], vpls[:, 4:7]) + off_plane**2
    away = np.where(vpls[:, 3] > 0, away, np.inf)
    owner, moved = away.argmin(1), np.tile(DARK, (len(vpls), 1))
    for number in np.unique(owner):
        own = samples[owner == number]
        middle, facing = own[:, :3].mean(0), own[:, 4:7].sum(0)
        # The radius of a disc with the cluster's spread. The samples' own discs add to it; where several
        # lights shine on one place, they overlap and are too large.
        between, within = ((own[:, :3] - middle) ** 2).sum(1).mean(), (own[:, 3] ** 2).mean() / 2
        spread = between + (min(within, 2 * between / len(own)) if len(own) > 1 else within)
        radius = np.sqrt(2 * spread)
        facing = facing / max(np.linalg.norm(facing), 1e-30)
        near = own[far(own, unit[owner == number], middle[None], facing[None]).argmin()]
        # Slide along the nearest sample's plane towards the centroid, but stay within that sample's disc: the
        # centroid of samples all round a box lies inside the box.
        slide = middle - near[:3]
        slide -= near[4:7] * (near[4:7] @ slide)
        slide *= min(1, near[3] / max(np.linalg.norm(slide), 1e-30))
        moved[number] = [*near[:3] + slide, radius, *near[4:7], 0, *own[:, 8:11].sum(0), 0]
    return moved
