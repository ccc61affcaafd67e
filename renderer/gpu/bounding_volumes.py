"""Trees of axis-aligned boxes, built bottom-up by whole-array steps.

Parallel locally-ordered clustering (Meister and Bittner 2018): items stand in Morton order; in each round
every cluster looks for the neighbour within `_REACH` places that makes the smallest box with it, and those
that chose each other merge. A short reach does best here: with one of 16, rays open a fifth more pairs of
nodes in rooms and among chess men.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int64

NODE_DTYPE = np.dtype([("low", "f4", 3), ("child", "u4"), ("high", "f4", 3), ("padding", "u4")])
"""A box and what is in it; nodes stand in pairs, the two children of one parent."""

COUNT_BITS = 3
"""Low bits of `child` that hold a leaf's number of items, 0 for an inner node. The others hold its first
item, or the first node of its pair of children."""

LEAF_ITEMS = 4
"""At most so many items in a leaf; fewer where the surface-area estimate says that a split pays."""

# Neighbours along the Morton curve that a cluster looks at, on either side. A choice.
_REACH = 2
# Bits of a Morton code along an axis. A choice: finer than any box that rays tell apart.
_MORTON_BITS = 16
# The surface-area estimate's price of one item, in prices of opening one pair of nodes.
_ITEM_COST = 1.0
_FARTHEST = np.finfo(np.float32).max


@dataclass(frozen=True, eq=False)
class BoundingVolumes:
    """A binary tree of boxes around items."""

    nodes: np.ndarray
    """[pairs, 2] of `NODE_DTYPE`; none where all items fit in one leaf."""
    root: int
    """As `child` of a node."""
    order: Int64[np.ndarray, " items"]
    """Which item stands at each place of the leaves."""
    low: Float32[np.ndarray, "3"]
    high: Float32[np.ndarray, "3"]
    depth: int
    """Pairs from the root to the deepest leaf."""


def build_bounding_volumes(
    low: Float32[np.ndarray, "items 3"],
    high: Float32[np.ndarray, "items 3"],
    leaf_items: int,
    max_depth: int,
) -> BoundingVolumes:
    """The tree of boxes over `items` boxes, at least one.

    Args:
        leaf_items: at most so many items in a leaf, from 1 to `LEAF_ITEMS`.
        max_depth: `BoundingVolumes.depth` is at most this; above log₂(items).
    """
    order = np.argsort(_morton_codes(low, high), kind="stable")
    clusters = _Clusters(np.concatenate([low[order].T, -high[order].T]), max_depth)
    tree = clusters.volumes(order, leaf_items)
    assert tree.depth <= max_depth, f"{len(low)} boxes do not fit in a tree of depth {max_depth}"
    return tree


class _Clusters:
    """The tree while it grows: clusters 0 … items − 1 are the items, each later one is two earlier ones.

    Boxes are rows (low, −high), so that a union is one minimum.
    """

    def __init__(self, boxes: np.ndarray, max_depth: int):
        self._items = boxes.shape[1]
        self._boxes = np.empty((6, 2 * self._items - 1), np.float32)
        self._boxes[:, : self._items] = boxes
        self._children = np.empty((2, self._items - 1), np.int64)
        self._rounds: list[slice] = []
        self._merge_all(max_depth)

    def _merge_all(self, max_depth: int) -> None:
        made = self._items
        current = np.arange(self._items)
        boxes = self._boxes[:, : self._items]
        while len(current) > 1:
            # Each round deepens the tree by at most one, and neighbour with neighbour halves the clusters.
            spare = max_depth - len(self._rounds) - (len(current) - 1).bit_length()
            first, second = _chosen_pairs(boxes) if spare > 0 else _neighbours(len(current))
            stop = made + len(first)
            self._children[:, made - self._items : stop - self._items] = current[first], current[second]
            merged = np.minimum(boxes[:, first], boxes[:, second])
            self._boxes[:, made:stop] = merged
            self._rounds.append(slice(made, stop))
            current[first] = np.arange(made, stop)
            boxes = boxes.copy()
            boxes[:, first] = merged
            kept = np.ones(len(current), bool)
            kept[second] = False
            current, boxes, made = current[kept], boxes[:, kept], stop

    def volumes(self, order: np.ndarray, leaf_items: int) -> BoundingVolumes:
        items, clusters = self._items, 2 * self._items - 1
        area = _half_area(self._boxes)
        count, cost = np.ones(clusters, np.int64), area * np.float32(_ITEM_COST)
        pairs, depth = np.zeros(clusters, np.int64), np.zeros(clusters, np.int64)
        for merged in self._rounds:
            left, right = self._children[:, merged.start - items : merged.stop - items]
            count[merged] = count[left] + count[right]
            split = area[merged] + cost[left] + cost[right]
            whole = area[merged] * count[merged].astype(np.float32) * np.float32(_ITEM_COST)
            is_leaf = (count[merged] <= leaf_items) & (whole <= split)
            cost[merged] = np.where(is_leaf, whole, split)
            pairs[merged] = np.where(is_leaf, 0, 1 + pairs[left] + pairs[right])
            depth[merged] = np.where(is_leaf, 0, 1 + np.maximum(depth[left], depth[right]))
        # Depth first: a pair's first child comes right after it, with all its own before the second.
        place, node = np.zeros(clusters, np.int64), np.zeros(clusters, np.int64)
        is_inner = pairs > 0
        for merged in reversed(self._rounds):
            left, right = self._children[:, merged.start - items : merged.stop - items]
            place[left], place[right] = place[merged], place[merged] + count[left]
            node[left], node[right] = node[merged] + 1, node[merged] + 1 + pairs[left]
            # What would split may lie in what is a leaf.
            is_inner[left] &= is_inner[merged]
            is_inner[right] &= is_inner[merged]
        child = np.where(is_inner, (2 * node) << COUNT_BITS, (place << COUNT_BITS) | count)
        inner = items + np.flatnonzero(is_inner[items:])
        nodes = np.zeros((len(inner), 2), NODE_DTYPE)
        for side in (0, 1):
            of_side = self._children[side, inner - items]
            nodes["low"][node[inner], side] = self._boxes[:3, of_side].T
            nodes["high"][node[inner], side] = -self._boxes[3:, of_side].T
            nodes["child"][node[inner], side] = child[of_side]
        in_leaves = np.empty(items, np.int64)
        in_leaves[place[:items]] = order
        return BoundingVolumes(
            nodes, int(child[-1]), in_leaves, self._boxes[:3, -1].copy(), -self._boxes[3:, -1], int(depth[-1])
        )


def _chosen_pairs(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clusters whose best partners are each other, as positions (first < second)."""
    count = boxes.shape[1]
    smallest = np.full(count, np.inf, np.float32)
    partner = np.zeros(count, np.int64)
    positions = np.arange(count)
    for step in range(1, min(_REACH, count - 1) + 1):
        area = _half_area(np.minimum(boxes[:, :-step], boxes[:, step:]))
        for mine, other in ((slice(None, -step), slice(step, None)), (slice(step, None), slice(None, -step))):
            better = area < smallest[mine]
            np.copyto(smallest[mine], area, where=better)
            np.copyto(partner[mine], positions[other], where=better)
    first = np.flatnonzero((partner[partner] == positions) & (positions < partner))
    # Boxes that all cost the same may find no one: each then prefers another.
    return (first, partner[first]) if 16 * len(first) >= count else _neighbours(count)


def _neighbours(count: int) -> tuple[np.ndarray, np.ndarray]:
    first = np.arange(0, count - 1, 2)
    return first, first + 1


def _half_area(boxes: np.ndarray) -> np.ndarray:
    """Half the surface of boxes given as rows (low, −high)."""
    x, y, z = -(boxes[:3] + boxes[3:])
    return x * y + y * z + z * x


def _morton_codes(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Places of the boxes' centres along a Z-order curve through a cube around them all."""
    center = 0.5 * low.astype(np.float64) + 0.5 * high
    corner = center.min(axis=0)
    side = max(float((center.max(axis=0) - corner).max()), np.finfo(np.float64).tiny)
    cells = ((center - corner) / side * (2**_MORTON_BITS - 1)).astype(np.uint64)
    # Spread 16 bits to every third place.
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):  # fmt: skip
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    return cells[:, 0] | (cells[:, 1] << np.uint64(1)) | (cells[:, 2] << np.uint64(2))
