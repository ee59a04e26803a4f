// Positions of a rig's arm and camera for drawing, by the formulas of docs/internals/virtual-axes.md. World: X to the
// right, Y up, Z backward; the camera at rest looks along −Z. Angles are in degrees.

import { M } from "./protocol.js";

/** Each type's axes, in the order of VIRT_CONFIG; `turns` are the axes in degrees. */
export const TYPES = {
  [M.VIRT_BOOM_SWING_TRACK]: { name: "Boom, swing, track", axes: ["boom", "swing", "track", "pan", "tilt", "roll"], arm: true },
  [M.VIRT_SWING_PAN]: { name: "Swing, pan", axes: ["swing", "pan"] },
  [M.VIRT_Y_SWING_TRACK]: { name: "Y, swing, track", axes: ["y", "swing", "track", "pan", "tilt", "roll"], arm: true },
  [M.VIRT_X_Y_Z]: { name: "X, Y, Z", axes: ["x", "y", "z", "pan", "tilt", "roll"] },
};

const TABLE_BEGIN = -60; // degrees

/** Return the rig's joints in units and degrees, counted from step 0, by the boom's table if there is one. steps(motor):
 * returns a motor's position. */
export function joints(rig, steps) {
  return rig.axes.map(({ motor, perUnit }, i) => {
    const at = motor ? steps(motor) ?? 0 : 0;
    if (i === 0 && rig.table && motor) return boom(rig.table, at);
    return motor && perUnit ? at / perUnit : 0;
  });
}

/** Return the boom's angle from its table, at most the table's ends. */
function boom(table, step) {
  const sign = Math.sign(table[1] - table[0]);
  const next = table.findIndex((value) => sign * value >= sign * step);
  if (next < 0) return TABLE_BEGIN + table.length - 1;
  if (next === 0) return TABLE_BEGIN;
  return TABLE_BEGIN + next - (table[next] - step) / (table[next] - table[next - 1]);
}

const radians = (degrees) => (degrees * Math.PI) / 180;

/** Convert a vector from the camera's frame (x right, y forward, z up) to the world's: Rz(pan)·Rx(tilt)·Ry(roll). */
function turned([x, y, z], pan, tilt, roll) {
  const [cp, sp, ct, st, cr, sr] = [pan, tilt, roll].flatMap((angle) => [Math.cos(radians(angle)), Math.sin(radians(angle))]);
  const [x1, z1] = [x * cr + z * sr, z * cr - x * sr];
  const [y2, z2] = [y * ct - z1 * st, y * st + z1 * ct];
  const [x3, y3] = [x1 * cp - y2 * sp, x1 * sp + y2 * cp];
  return [x3, z2, -y3]; // forward is −Z in the world
}

/** rig: {type, length, extension, nodal: [x, y, z]}; joints: in the order of the type's axes.
 * {column, joint, camera: points of the world or null, looks: the camera's direction, pan, tilt, roll}. */
export function pose(rig, joints) {
  const at = Object.fromEntries(TYPES[rig.type].axes.map((name, i) => [name, joints[i] ?? 0]));
  const swing = at.swing ?? 0;
  const [pan, tilt, roll] = [(at.pan ?? 0) + swing, at.tilt ?? 0, at.roll ?? 0];
  const looks = turned([0, 1, 0], pan, tilt, roll);
  if (rig.type === M.VIRT_SWING_PAN) return { column: null, joint: null, camera: [0, 0, 0], looks, pan, tilt, roll };
  const offset = turned(rig.nodal, pan, tilt, roll);
  const [mount, column, joint] = rig.type === M.VIRT_X_Y_Z ? [[at.x, at.y, at.z], null, null] : arm(rig, at, swing);
  return { column, joint, camera: mount.map((value, i) => value + offset[i]), looks, pan, tilt, roll };
}

/** Return the arm's end, the foot of its column, and the start of its extension. */
function arm(rig, at, swing) {
  const booms = rig.type === M.VIRT_BOOM_SWING_TRACK;
  const level = booms ? rig.length * Math.cos(radians(at.boom)) : rig.length;
  const height = booms ? rig.length * Math.sin(radians(at.boom)) : at.y;
  const out = (reach) => [reach * Math.sin(radians(swing)), height, at.track - reach * Math.cos(radians(swing))];
  return [out(level + rig.extension), [0, 0, at.track], out(level)];
}
