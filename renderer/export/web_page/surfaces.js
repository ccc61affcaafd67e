// --- the nearest surface to a point, and how far a point may move. Follows page.js in one script. -----------------
// The smallest share of a clearance by which a point moves at once where it runs along a surface. A choice.
const SHORTEST_STEP = 0.25;
// Share of a clearance that rounding may take from it.
const ROUNDING = 1e-6;

// The distance from a point to a segment.
function segmentDistance(point, start, end) {
  const [along, offset] = [add(end, start, -1), add(point, start, -1)];
  const share = dot(offset, along) / (dot(along, along) || 1);
  return Math.hypot(...add(offset, along, -Math.min(Math.max(share, 0), 1)));
}

// The distance from a point to a triangle: to its plane, or to its nearest edge.
function triangleDistance(point, corners) {
  const [a, b, c] = corners;
  const normal = cross(add(b, a, -1), add(c, a, -1));
  const area = Math.hypot(...normal);
  const inside = corners.every((corner, i) => {
    const edge = add(corners[(i + 1) % 3], corner, -1);
    return dot(cross(normal, edge), add(point, corner, -1)) >= 0;
  });
  if (inside && area > 0) return Math.abs(dot(normal, add(point, a, -1))) / area;
  return Math.min(...corners.map((corner, i) => segmentDistance(point, corner, corners[(i + 1) % 3])));
}

// The scene's triangles in their tree of boxes, which is also what the visibility maps' rays go through.
class Surfaces {
  // `margin`: how near a moving point may come to a surface, in world units.
  constructor(scene, margin) {
    const values = (name, view) => new view(scene.bytes(name).slice().buffer);
    [this.boxes, this.links] = [values("ray_nodes", Float32Array), values("ray_nodes", Uint32Array)];
    this.triangles = values("ray_triangles", Float32Array);
    this.margin = margin;
  }

  // The distance from a point to the nearest surface.
  clearance(point) {
    let nearest = Infinity;
    // Pairs of a distance to a box and what is in it, as `child` in renderer/gpu/bounding_volumes.py.
    const stack = [[0, bundle.ray_tree.root]];
    while (stack.length > 0) {
      const [distance, child] = stack.pop();
      if (distance >= nearest) continue;
      const count = child & ((1 << bundle.ray_tree.count_bits) - 1);
      const first = child >>> bundle.ray_tree.count_bits;
      for (let i = first; i < first + count; ++i) {
        nearest = Math.min(nearest, triangleDistance(point, this.corners(i)));
      }
      if (count > 0) continue;
      const pair = [first, first + 1].map((node) => [this.boxDistance(point, node), this.links[8 * node + 3]]);
      if (pair[0][0] < pair[1][0]) pair.reverse();
      stack.push(...pair);
    }
    return nearest;
  }

  corners(triangle) {
    return [0, 4, 8].map((at) => Array.from(this.triangles.subarray(12 * triangle + at, 12 * triangle + at + 3)));
  }

  boxDistance(point, node) {
    const [low, high] = [8 * node, 8 * node + 4];
    return Math.hypot(...point.map((x, i) => Math.max(this.boxes[low + i] - x, x - this.boxes[high + i], 0)));
  }

  // The last point of a straight way that keeps the margin from every surface; `to` itself if all of it does. A start
  // within the margin may come no nearer. No step is longer than the clearance, so none passes a surface (Hart 1996);
  // a start on a surface, nearer than a thousandth of the margin, may leave it on either side.
  farthest(from, to) {
    const way = add(to, from, -1);
    const length = Math.hypot(...way);
    let clearance = this.clearance(from);
    const kept = Math.min(this.margin, clearance);
    let [at, before] = [0, 0];
    while (clearance >= kept * (1 - ROUNDING)) {
      if (at >= length) return to;
      before = at;
      at = Math.min(length, at + Math.max(clearance - kept, SHORTEST_STEP * Math.max(clearance, 1e-3 * this.margin)));
      clearance = this.clearance(add(from, way, at / length));
    }
    return before > 0 ? add(from, way, before / length) : from;
  }
}
