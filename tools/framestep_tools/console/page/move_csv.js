// Moves as CSV, as for framestep upload: a column `frame`, then a column per motor in their order, with positions in
// whole steps. Variants that spreadsheets write are accepted.

const LONGEST = 80; // characters of a line in an error text
const LEAST = -2147483648;
const MOST = 2147483647;

/** A file is not a move. The text names the line. */
export class MoveError extends Error {}

function shown(cells) {
  const text = cells.join(",");
  return text.length <= LONGEST ? text : `${text.slice(0, LONGEST)}…`;
}

function trimmed(cells, count) {
  const found = [...cells];
  while (found.length > count && found.at(-1) === "") found.pop();
  return found;
}

function whole(cell, name, where) {
  if (!/^[+-]?\d+(\.0*)?$/.test(cell)) throw new MoveError(`${where}: expected a whole number for ${name}, found “${cell}”`);
  const value = Number.parseInt(cell, 10);
  if (value < LEAST || value > MOST) throw new MoveError(`${where}: positions have to fit 32 bits signed, found ${value} for ${name}`);
  return value;
}

/** Return {startFrame, endFrame, names, positions: an array per motor}. Throws MoveError. name: the file's. */
export function parseMove(text, name) {
  const lines = text.replace(/^\uFEFF/, "").split(/\r\n|\r|\n/);
  const count = (sign) => lines[0].split(sign).length;
  const between = ["\t", ";", ","].reduce((best, sign) => (count(sign) > count(best) ? sign : best));
  const rows = lines.map((line) => line.split(between).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1")));
  while (rows.length && rows.at(-1).every((cell) => cell === "")) rows.pop();
  const header = trimmed(rows[0] ?? [], 0);
  if (header.length < 2 || header[0].toLowerCase() !== "frame") {
    throw new MoveError(`${name}, line 1: expected the header frame,<motor 1>,<motor 2>…, found “${shown(header)}”`);
  }
  if (rows.length < 2) throw new MoveError(`${name}: expected a line for each frame, found none`);
  const positions = header.slice(1).map(() => []);
  let frame = null;
  rows.slice(1).forEach((row, at) => {
    const where = `${name}, line ${at + 2}`;
    const cells = trimmed(row, header.length);
    if (cells.length !== header.length) throw new MoveError(`${where}: expected ${header.length} whole numbers, found “${shown(cells)}”`);
    const numbers = cells.map((cell, column) => whole(cell, header[column], where));
    if (frame !== null && numbers[0] !== frame + 1) throw new MoveError(`${where}: expected frame ${frame + 1}, found ${numbers[0]}`);
    frame = numbers[0];
    positions.forEach((column, motor) => column.push(numbers[motor + 1]));
  });
  return { startFrame: frame - positions[0].length + 1, endFrame: frame, names: header.slice(1), positions };
}

/** Return a motor's position (motors from 0) at any frame; straight between frames, as drawn. */
export function positionAt(move, motor, frame) {
  const steps = move.positions[motor];
  const at = Math.min(Math.max(frame - move.startFrame, 0), steps.length - 1);
  const before = Math.floor(at);
  const after = Math.min(before + 1, steps.length - 1);
  return steps[before] + (steps[after] - steps[before]) * (at - before);
}

/** Return the text of a move, as parseMove takes it. */
export function moveText(move) {
  const quoted = (name) => (/[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name);
  const lines = move.positions[0].map((_, i) => [move.startFrame + i, ...move.positions.map((steps) => steps[i])].join(","));
  return `${[["frame", ...move.names.map(quoted)].join(","), ...lines].join("\n")}\n`;
}
