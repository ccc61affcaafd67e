// --- the camera, which turns about a point and passes through no surface. Follows surfaces.js in one script. ------
// How near the eye may come to a surface, in diagonals of the scene: 2 cm in a room of 10 m. A choice.
const EYE_MARGIN = 0.002;
// The largest turn that is checked at once, in radians. A choice.
const LARGEST_TURN = 0.05;
// Shares of its distance at which the eye is tried where a surface is in the way of a turn. Choices: with the
// smallest, a turn by `LARGEST_TURN` still follows a wall that it meets at 3°.
const NEARER = [1, 0.95, 0.8, 0.5];
// By how much the eye goes back outwards in one turn after it was held in by a surface. A choice.
const RETURN = 1.1;
// The largest sine of the angle by which the camera looks up or down; at 1 the image would flip. A choice.
const STEEPEST = 0.98;

// The camera, about the point on its axis that is nearest to the scene's centre.
class OrbitCamera {
  constructor(surfaces, to_world) {
    this.surfaces = surfaces;
    this.to_world = to_world;
    const backward = column(to_world, 2);
    this.distance = Math.max(dot(add(this.eye, center, -1), backward), 0.05 * bundle.diagonal);
    this.pivot = add(this.eye, backward, -this.distance);
    // The distance that was asked for; a surface may hold the eye in at a shorter one.
    this.asked = this.distance;
  }

  get eye() {
    return column(this.to_world, 3);
  }

  // Turn about the pivot [radians]: to the side, and up or down.
  turnBy(yaw, pitch) {
    const turns = Math.ceil(Math.hypot(yaw, pitch) / LARGEST_TURN);
    for (let i = 0; i < turns; ++i) {
      this.turn([0, 1, 0], yaw / turns);
      this.turn(column(this.to_world, 0), pitch / turns);
    }
  }

  // One turn about an axis through the pivot. Where a surface is in its way, the eye moves in towards the pivot, and
  // later out again; where that does not help either, nothing turns.
  turn(axis, angle) {
    if (angle === 0) return;
    const there = turned(this.to_world, this.pivot, axis, angle);
    const [sine, before] = [there, this.to_world].map((matrix) => Math.abs(column(matrix, 2)[1]));
    if (sine > STEEPEST && sine > before) return;
    const at = (distance) => add(this.pivot, column(there, 2), distance);
    const share = NEARER.find((nearer) => {
      const place = at(nearer * this.distance);
      return this.surfaces.farthest(this.eye, place) === place;
    });
    if (share === undefined) return;
    const outer = Math.min(this.asked, RETURN * this.distance);
    this.to_world = there;
    this.place(this.surfaces.farthest(at(share * this.distance), at(outer)));
  }

  // Multiply the distance from the pivot, as far as no surface is in the way.
  approach(factor) {
    this.place(this.surfaces.farthest(this.eye, add(this.pivot, column(this.to_world, 2), this.distance * factor)));
    this.asked = this.distance;
  }

  place(eye) {
    this.distance = Math.hypot(...add(eye, this.pivot, -1));
    this.to_world = this.to_world.map((row, i) => (i < 3 ? [...row.slice(0, 3), eye[i]] : row));
  }
}
