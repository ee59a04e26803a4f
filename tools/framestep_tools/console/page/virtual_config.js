// VIRT_CONFIG: each type of rig has a layout of its own (docs/protocol-notes.md, 9.2 and 9.3).

import { TYPES } from "./kinematics.js";
import { M } from "./protocol.js";

const MILLI = 1000;
const POSITION = 100_000;

function dword(out, value) {
  if (!Number.isInteger(value) || value < -2147483648 || value > 2147483647) throw new RangeError(`${value} does not fit into VIRT_CONFIG`);
  for (let i = 0; i < 4; i += 1) out.push((value >> (8 * i)) & 255);
}

/** The payload. rig: {type, axes: [{motor, perUnit, position}], length, extension, nodal, safe: null for none}; motor 0:
 * no such axis. RangeError where a number does not fit. */
export function packConfig(rig) {
  const out = [rig.type];
  if (rig.type === M.VIRT_NONE) return out;
  for (const { motor, perUnit, position } of rig.axes) {
    dword(out, motor);
    dword(out, Math.round(perUnit * MILLI));
    if (rig.type !== M.VIRT_SWING_PAN) dword(out, Math.round(position * POSITION));
  }
  if (rig.type === M.VIRT_SWING_PAN) return out;
  const lengths = TYPES[rig.type].arm ? [rig.length, rig.extension, ...rig.nodal] : rig.nodal;
  if (rig.safe !== null) lengths.push(rig.safe);
  for (const length of lengths) dword(out, Math.round(length * MILLI));
  return out;
}
