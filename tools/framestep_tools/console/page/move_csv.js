// Moves as CSV, as for framestep upload: a column `frame`, then a column per motor, headed by its axis or its number, with
// positions in whole steps. Variants that spreadsheets write are accepted.

const LONGEST = 80; // characters of a line in an error text
const LEAST = -2147483648;
const MOST = 2147483647;
const MOTORS = 32;
const COMMENT = /^\s*(?:\/\/|#)(.*)/;
// as in framestep_tools/move/table.py
const DIGITS = String.raw`[+-]?\.?\d(?:[\d.,/+-]|e(?=[\d+-]))*`;
const RATE = new RegExp(String.raw`(?:fps|frame ?rate|frames per second)[^\w.+-]{0,3}(${DIGITS})(?!\w)|(?<![\w.,/+-])(${DIGITS}) ?(?:fps|frames/s|frames per second)\b`, "gi");
const NAMES_RATE = /^\s*(?:fps|frame ?rate|frames per second)\s*[:=]\s*(.*)/i;
const UNIT = /^(.*\S)\s*[[(]\s*(steps|mm|cm|m|in|ft|deg|rad|°)\s*[\])]$/i;
const NUMBER = /^(?:motor[ _]?)?(\d{1,9})$/i;
const GROUPED = /^[+-]?[1-9]\d{0,2}\.\d{3}$/; // may be thousands
const MARKS = [[[0xef, 0xbb, 0xbf], "utf-8"], [[0xff, 0xfe], "utf-16le"], [[0xfe, 0xff], "utf-16be"]];

/** A file is not a move. The text names the line. foreign: it may be another program's. */
export class MoveError extends Error {
  foreign = false;
}

/** Return the text of a file, whose byte order mark may name another encoding than UTF-8. Throws MoveError. */
export async function textOf(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  const [, encoding] = MARKS.find(([mark]) => mark.every((byte, at) => bytes[at] === byte)) ?? [null, "utf-8"];
  try {
    return new TextDecoder(encoding, { fatal: true }).decode(bytes);
  } catch {
    throw new MoveError(`${file.name} is not text in UTF-8 or, with its mark, in UTF-16`);
  }
}

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

/** Return the frames per second in comments such as "fps: 25" or "24000/1001 fps", or null. Throws MoveError if none can be so. */
function rateIn(comments, name) {
  const found = [];
  for (const [at, comment] of comments) {
    const named = [...comment.matchAll(RATE)].map(([, after, before]) => (after ?? before).replace(/[.,/+-]+$/, ""));
    const [, wrong] = (named.length ? null : comment.match(NAMES_RATE)) ?? [];
    if (wrong !== undefined) named.push(wrong.trim());
    for (const text of named) {
      const [above, below = 1] = text.replaceAll(",", ".").split("/").map(Number);
      const rate = above / below;
      if (!(rate >= 0.001 && rate <= 1000)) throw new MoveError(`${name}, line ${at}: expected frames per second from 0.001 to 1000, such as 25 or 24000/1001, found “${text}”`);
      found.push([rate, text]);
      if (rate !== found[0][0]) throw new MoveError(`${name}, line ${at}: comments say ${found[0][1]} and ${text} frames per second: leave one`);
    }
  }
  return found[0]?.[0] ?? null;
}

/**
 * Return {motors, counted} of the columns with these headings: a name in axes.toml or a motor's number decides, others count in
 * their order; counted says which these are. Throws MoveError if two columns are for one motor, or axes.toml calls it otherwise.
 */
function motorsOf(headings, axes, name) {
  const counted = [];
  const motors = [];
  headings.forEach((heading, at) => {
    const where = `${name}, column “${heading}”`;
    const [, bare, unit] = heading.match(UNIT) ?? [null, heading, "steps"];
    if (unit.toLowerCase() !== "steps") throw new MoveError(`${where}: a move has steps, this is in ${unit}: framestep import converts it`);
    const same = (change) => axes.list.filter((axis) => change(axis.name) === change(bare));
    const [axis] = [same((text) => text), same((text) => text.toLowerCase())].find((found) => found.length === 1) ?? [];
    const number = bare.match(NUMBER);
    let motor = number ? Number(number[1]) : axis?.motor;
    if (number && (motor < 1 || motor > MOTORS)) throw new MoveError(`${where}: expected a motor from 1 to ${MOTORS}`);
    if (number && axis && axis.motor !== motor) throw new MoveError(`${where}: axes.toml has an axis of this name for motor ${axis.motor}: write motor ${motor} or motor ${axis.motor}`);
    if (motor === undefined) {
      motor = at + 1;
      const { settings } = axes.of(motor);
      if (settings) throw new MoveError(`${where}: no axis has this name, and axes.toml calls motor ${motor} “${settings.name}”: head the column by the name of an axis or by a motor's number, such as motor ${motor}`);
      counted.push(`${heading || "the column without a name"} is motor ${motor}`);
    }
    if (motors.includes(motor)) throw new MoveError(`${where}: it is for motor ${motor}, as is column “${headings[motors.indexOf(motor)]}”`);
    motors.push(motor);
  });
  return { motors, counted: counted.join(", ") };
}

/**
 * Return {startFrame, endFrame, motors: the number of each, names and positions: of each of these motors, fps: that the file
 * names, or null, counted: as motorsOf}. Throws MoveError. name: the file's; axes: names and units of the motors.
 */
export function parseMove(text, name, axes) {
  const comments = [];
  const lines = [];
  text.replace(/^\uFEFF/, "").replace(/[\u001a\0\s]*\u001a[\u001a\0\s]*$/, "").split(/\r\n|\r|\n/).forEach((line, at) => {
    const comment = line.match(COMMENT);
    if (comment) comments.push([at + 1, comment[1]]);
    else if (lines.length || line.trim()) lines.push([at + 1, line]);
  });
  let between = null;
  const separator = lines[0]?.[1].trim().match(/^"?sep=(.)"?$/i);
  if (separator) {
    [, between] = separator;
    lines.shift();
  }
  const first = lines[0]?.[1] ?? "";
  const count = (sign) => first.split(sign).length;
  between ??= ["\t", ";", ","].reduce((best, sign) => (count(sign) > count(best) ? sign : best));
  const rows = lines.map(([at, line]) => [at, line.split(between).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"))]);
  while (rows.length && rows.at(-1)[1].every((cell) => cell === "")) rows.pop();
  const header = trimmed(rows[0]?.[1] ?? [], 0);
  if (header.length < 2 || header[0].toLowerCase() !== "frame") {
    const error = new MoveError(`${name}, line ${rows[0]?.[0] ?? 1}: expected the header frame,<motor 1>,<motor 2>…, found “${shown(header)}”`);
    error.foreign = rows.length > 0;
    throw error;
  }
  if (rows.length < 2) throw new MoveError(`${name}: expected a line for each frame, found none`);
  const { motors, counted } = motorsOf(header.slice(1), axes, name);
  const positions = motors.map(() => []);
  let frame = null;
  let grouped = null; // a cell that may be thousands, and its line
  let decimals = false; // whether another cell shows that the point is a decimal one
  rows.slice(1).forEach(([at, row]) => {
    const where = `${name}, line ${at}`;
    const cells = trimmed(row, header.length);
    if (cells.length !== header.length) throw new MoveError(`${where}: expected ${header.length} whole numbers, found “${shown(cells)}”`);
    const numbers = cells.map((cell, column) => {
      if (GROUPED.test(cell)) grouped ??= [cell, where];
      else decimals ||= cell.includes(".");
      return whole(cell.replace(GROUPED, (found) => found.split(".")[0]), header[column], where);
    });
    if (frame !== null && numbers[0] !== frame + 1) throw new MoveError(`${where}: expected frame ${frame + 1}, found ${numbers[0]}`);
    frame = numbers[0];
    positions.forEach((column, motor) => column.push(numbers[motor + 1]));
  });
  if (grouped && (!decimals || !grouped[0].endsWith(".000"))) {
    const [one] = grouped[0].split(".");
    throw new MoveError(`${grouped[1]}: “${grouped[0]}” may be ${one} with decimals or ${grouped[0].replace(".", "")}: write whole steps, without fractions and signs between thousands`);
  }
  const order = motors.map((_, at) => at).sort((a, b) => motors[a] - motors[b]);
  return {
    startFrame: frame - positions[0].length + 1,
    endFrame: frame,
    motors: order.map((at) => motors[at]),
    names: order.map((at) => axes.of(motors[at]).settings?.name ?? (NUMBER.test(header[at + 1]) ? `motor ${motors[at]}` : header[at + 1])),
    positions: order.map((at) => positions[at]),
    fps: rateIn(comments, name),
    counted,
  };
}

/** Return a position at any frame, of the motor with this index in the move; straight between frames, as drawn. */
export function positionAt(move, index, frame) {
  const steps = move.positions[index];
  const at = Math.min(Math.max(frame - move.startFrame, 0), steps.length - 1);
  const before = Math.floor(at);
  const after = Math.min(before + 1, steps.length - 1);
  return steps[before] + (steps[after] - steps[before]) * (at - before);
}

/** Return the text of a move, as parseMove takes it. A column that is not at its motor's place is headed by the motor. */
export function moveText(move) {
  const quoted = (name) => (/[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name);
  const headings = move.names.map((name, at) => (move.motors[at] === at + 1 ? quoted(name) : `motor ${move.motors[at]}`));
  const lines = move.positions[0].map((_, i) => [move.startFrame + i, ...move.positions.map((steps) => steps[i])].join(","));
  const rate = move.fps ? `# fps: ${Number(move.fps.toPrecision(10))}\n` : "";
  return `${rate}${[["frame", ...headings].join(","), ...lines].join("\n")}\n`;
}
