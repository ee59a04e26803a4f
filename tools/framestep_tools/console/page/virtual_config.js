// VIRT_CONFIG: each type of rig has a layout of its own (docs/internals/protocol-notes.md, 9.2 and 9.3).

import { TYPES } from "./kinematics.js";
import { M } from "./protocol.js";

const MILLI = 1000;
const POSITION = 100_000;

function dword(out, value) {
  if (!Number.isInteger(value) || value < -2147483648 || value > 2147483647) throw new RangeError(`${value} does not fit into VIRT_CONFIG`);
  for (let i = 0; i < 4; i += 1) out.push((value >> (8 * i)) & 255);
}

const NUMBERS = 121; // numbers of a boom table: −60 to 60 degrees

/** Parse a boom table: the motor's step for each degree from −60 to 60. Null for an empty text; throws RangeError, with the
 * mistake, for anything else. */
export function parseTable(text) {
  const cells = text.split(/[\s,;]+/).filter((cell) => cell !== "");
  if (!cells.length) return null;
  if (cells.length !== NUMBERS) throw new RangeError(`the boom table: expected ${NUMBERS} numbers, a step for each degree from −60 to 60, found ${cells.length}`);
  const table = cells.map((cell) => {
    if (!/^[+-]?\d+$/.test(cell)) throw new RangeError(`the boom table: expected whole numbers, found “${cell}”`);
    return Number(cell);
  });
  const rises = Math.sign(table[1] - table[0]);
  const bad = table.findIndex((step, i) => i > 0 && Math.sign(step - table[i - 1]) !== (rises || 1));
  if (bad > 0) throw new RangeError(`the boom table has to rise or fall throughout: it does not from ${bad - 61} to ${bad - 60} degrees`);
  return table;
}

/** Return the payload. rig: {type, axes: [{motor, perUnit, position}], length, extension, nodal, table: null for none, safe: null
 * for none}; motor 0: no such axis. Throws RangeError if a number does not fit. */
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
  for (const length of lengths) dword(out, Math.round(length * MILLI));
  if (rig.table) for (const step of rig.table) dword(out, step);
  if (rig.safe !== null) dword(out, Math.round(rig.safe * MILLI));
  return out;
}
