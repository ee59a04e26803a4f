// The rig as solids: of one of the virtual types, of an axes.toml whose names say what it is, or a track for each motor.

import { joints, pose, TYPES } from "./kinematics.js";
import { M } from "./protocol.js";
import { add, beam, cross, normal } from "./solids.js";

const ARM = 800; // of a crane that is known by its axes' names alone
const METAL = [141, 153, 166];
const DARK = [92, 103, 115];
const CAMERA = [47, 127, 184];
const ARM_COLOR = [201, 138, 43];
const TIES = 10;
const ROOM = 150; // between the tracks of motors without a rig
const TRACK = 1000;
// Names of axes by the joints that they move
const NAMES = { track: ["track", "slide", "slider", "dolly", "rail"], boom: ["boom"], swing: ["swing"], pan: ["pan"], tilt: ["tilt"], roll: ["roll"], x: ["x"], y: ["y", "lift", "height"], z: ["z"] };

/** Return the rig to draw: {ranges, parts(stepsOf), pose(stepsOf)}. configured: virtual axes as this page has set them, or null;
 * device: with axes and limits; stepsOf(motor): returns steps. */
export function rigOf(configured, device, used) {
  if (configured) return new Rig(configured, (stepsOf) => joints(configured, stepsOf), (name) => {
    const { motor, perUnit } = configured.axes[TYPES[configured.type].axes.indexOf(name)] ?? {};
    return motor ? span(device, motor, used).map((steps) => steps / perUnit).sort((a, b) => a - b) : null;
  });
  const found = Object.fromEntries(Object.entries(NAMES).map(([joint, names]) => [joint, device.axes.list.find(({ name }) => names.includes(name.toLowerCase()))]));
  const crane = found.boom || found.swing;
  const known = crane || found.x || (found.track && (found.pan || found.tilt)) || (found.pan && found.tilt);
  if (!known) return new Tracks(device, used);
  if (!crane && !found.x) found.x = found.track;
  const type = crane ? M.VIRT_BOOM_SWING_TRACK : M.VIRT_X_Y_Z;
  const of = (name) => found[name] && device.axes.of(found[name].motor);
  const at = (stepsOf) => TYPES[type].axes.map((name) => {
    const axis = of(name);
    const steps = axis && stepsOf(axis.motor);
    return steps === undefined ? 0 : axis.position(steps);
  });
  return new Rig({ type, length: ARM, extension: 0, nodal: [0, 0, 0] }, at, (name) => {
    const axis = of(name);
    return axis ? span(device, axis.motor, used).map((steps) => axis.position(steps)).sort((a, b) => a - b) : null;
  });
}

/** Return [lowest, highest] step of a motor: its limits, else what the move uses, else around its position. */
function span(device, motor, used) {
  const found = device.axes.of(motor).limits ?? device.limitsOf(motor) ?? used(motor);
  if (found && found[0] !== found[1]) return found;
  const at = device.state.positions[motor - 1] ?? 0;
  const some = Math.abs(device.axes.of(motor).perUnit) * (device.axes.of(motor).scaled ? 100 : 1000);
  return [at - some, at + some];
}

class Rig {
  #rig;
  #joints;
  #unit;
  #spans;

  /** jointsOf(stepsOf): the joints; spanOf(name): [lowest, highest] of a joint, or null without a motor. */
  constructor(rig, jointsOf, spanOf) {
    this.#rig = rig;
    this.#joints = jointsOf;
    this.#spans = Object.fromEntries(TYPES[rig.type].axes.map((name) => [name, spanOf(name)]));
    const longest = Math.max(...["track", "x", "y", "z"].map((name) => { const ends = this.#spans[name]; return ends ? ends[1] - ends[0] : 0; }));
    this.#unit = (TYPES[rig.type].arm ? Math.abs(rig.length) : longest * 0.6 || 500) / 800;
  }

  pose(stepsOf) {
    return pose(this.#rig, this.#joints(stepsOf));
  }

  get #floor() {
    if (this.#rig.type === M.VIRT_Y_SWING_TRACK) return (this.#spans.y?.[0] ?? 0) - 400 * this.#unit;
    if (this.#rig.type === M.VIRT_X_Y_Z) return (this.#spans.y?.[0] ?? 0) - 300 * this.#unit;
    return -650 * this.#unit;
  }

  /** Where its rails go: [from, to] on the floor. */
  get #rail() {
    const floor = this.#floor;
    if (this.#rig.type === M.VIRT_SWING_PAN) return null;
    if (TYPES[this.#rig.type].arm) {
      const ends = this.#spans.track;
      return ends && [[0, floor, ends[0]], [0, floor, ends[1]]];
    }
    const ends = this.#spans.x;
    return ends && [[ends[0], floor, 0], [ends[1], floor, 0]];
  }

  /** What stands still. */
  fixed() {
    const rail = this.#rail;
    if (!rail) return [];
    const u = this.#unit;
    const along = normal(add(rail[1], rail[0], -1));
    const side = cross([0, 1, 0], along);
    const [from, to] = [add(rail[0], along, -150 * u), add(rail[1], along, 150 * u)];
    const ties = Array.from({ length: TIES + 1 }, (_, i) => add(from, add(to, from, -1), i / TIES)).map((at) => beam(add(add(at, side, -220 * u), [0, -20 * u, 0]), add(add(at, side, 220 * u), [0, -20 * u, 0]), 20 * u, 40 * u, DARK));
    return [...ties, ...[-160, 160].map((off) => beam(add(from, side, off * u), add(to, side, off * u), 25 * u, 25 * u, METAL))];
  }

  /** What moves. */
  moving(stepsOf) {
    const u = this.#unit;
    const { column, joint, camera, looks } = this.pose(stepsOf);
    const floor = this.#floor;
    const parts = [];
    if (column) {
      const hinge = [column[0], joint[1], column[2]];
      if (this.#rig.type === M.VIRT_BOOM_SWING_TRACK) hinge[1] = 0;
      const back = add(hinge, add(joint, hinge, -1), -0.35);
      parts.push(
        beam([column[0], floor + 50 * u, column[2] - 190 * u], [column[0], floor + 50 * u, column[2] + 190 * u], 70 * u, 340 * u, DARK),
        beam([column[0], floor + 85 * u, column[2]], add(hinge, [0, -20 * u, 0]), 90 * u, 90 * u, METAL, [0, 0, 1]),
        beam(back, joint, 60 * u, 45 * u, ARM_COLOR),
        beam(back, add(back, add(hinge, back, -1), 0.25), 150 * u, 150 * u, DARK));
      if (Math.hypot(...add(camera, joint, -1)) > u) parts.push(beam(joint, camera, 40 * u, 35 * u, METAL));
    } else {
      const foot = [camera[0], floor, this.#rig.type === M.VIRT_X_Y_Z ? 0 : camera[2]];
      parts.push(beam(add(foot, [-170 * u, 50 * u, 0]), add(foot, [170 * u, 50 * u, 0]), 60 * u, 340 * u, DARK),
        beam(add(foot, [0, 80 * u, 0]), add([foot[0], camera[1], foot[2]], [0, -70 * u, 0]), 80 * u, 80 * u, METAL, [0, 0, 1]));
      if (Math.abs(camera[2] - foot[2]) > u) parts.push(beam([foot[0], camera[1] - 70 * u, foot[2]], [camera[0], camera[1] - 70 * u, camera[2]], 50 * u, 50 * u, METAL));
    }
    const from = (distance, down = 0) => add(add(camera, looks, distance * u), [0, -down * u, 0]);
    parts.push(beam(camera, from(0, 60), 40 * u, 40 * u, METAL, [0, 0, 1]),
      beam(from(-90, 130), from(90, 130), 120 * u, 90 * u, CAMERA),
      beam(from(90, 130), from(190, 130), 75 * u, 75 * u, DARK));
    return parts;
  }

  /** The camera's field of view: [its eye, four corners]. */
  sight(stepsOf) {
    const u = this.#unit;
    const { camera, looks } = this.pose(stepsOf);
    const side = normal(cross(Math.abs(looks[1]) > 0.99 ? [0, 0, 1] : [0, 1, 0], looks));
    const top = cross(looks, side);
    const eye = add(add(camera, looks, 200 * u), [0, -130 * u, 0]);
    const far = (a, b) => add(add(add(eye, looks, 460 * u), side, a * 160 * u), top, b * 100 * u);
    return [eye, far(-1, -1), far(1, -1), far(1, 1), far(-1, 1)];
  }

  /** The camera of a pose, for its path. */
  camera(stepsOf) {
    return this.pose(stepsOf).camera;
  }
}

/** A track for each motor, since nothing says how they stand to each other. */
class Tracks {
  #device;
  #used;

  constructor(device, used) {
    this.#device = device;
    this.#used = used;
  }

  get #motors() {
    return Array.from({ length: this.#device.motors }, (_, i) => i + 1);
  }

  fixed() {
    return this.#motors.flatMap((motor) => [-30, 30].map((off) => beam([-60, 0, motor * ROOM + off], [TRACK + 60, 0, motor * ROOM + off], 16, 16, METAL)));
  }

  moving(stepsOf) {
    return this.#motors.filter((motor) => stepsOf(motor) !== undefined).map((motor) => {
      const ends = span(this.#device, motor, this.#used);
      const share = Math.min(Math.max((stepsOf(motor) - ends[0]) / (ends[1] - ends[0]), 0), 1);
      const at = (this.#device.axes.of(motor).perUnit < 0 ? 1 - share : share) * TRACK;
      return beam([at - 50, 45, motor * ROOM], [at + 50, 45, motor * ROOM], 70, 90, motor % 2 ? ARM_COLOR : CAMERA);
    });
  }
}
