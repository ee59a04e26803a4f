// Names and units of the motors, as axes.toml has them: how positions and rates are shown, and how typed ones become steps.

import { UNITS } from "./protocol.js";

const SIGNS = { deg: "°", units: "" }; // shown instead of a unit's name, without a blank
const STEPS = "steps";

/** A motor's axis. Without an axis in the file its name is "motor 3" and its unit is the step. */
export class Axis {
  constructor(motor, settings = null) {
    this.motor = motor;
    this.settings = settings;
  }

  get name() {
    return this.settings?.name ?? `motor ${this.motor}`;
  }

  /** The name at the beginning of a line. */
  get title() {
    return this.settings?.name ?? `Motor ${this.motor}`;
  }

  /** Whether positions are not simply steps. */
  get scaled() {
    return this.settings !== null && !(this.unit === STEPS && this.perUnit === 1 && this.zero === 0);
  }

  get unit() {
    return this.settings?.unit ?? (this.settings ? "units" : STEPS);
  }

  /** Steps for one unit; negative if steps count down while the position rises. */
  get perUnit() {
    const per = this.settings?.steps_per_unit ?? 1;
    return this.settings?.invert ? -per : per;
  }

  get zero() {
    return this.settings?.zero ?? 0;
  }

  /** Decimals that show each step. */
  get decimals() {
    return Math.max(0, Math.ceil(Math.log10(Math.abs(this.perUnit))));
  }

  position(steps) {
    return steps / this.perUnit + this.zero;
  }

  steps(position) {
    return Math.round((position - this.zero) * this.perUnit);
  }

  /** Return a rate in units from one in steps, and the reverse. */
  rate(steps) {
    return steps / Math.abs(this.perUnit);
  }

  rateSteps(rate) {
    return Math.round(rate * Math.abs(this.perUnit));
  }

  /** [lowest, highest] step of the limits in axes.toml, or null. */
  get limits() {
    const { limits } = this.settings ?? {};
    return limits ? limits.map((end) => this.steps(end)).sort((a, b) => a - b) : null;
  }

  /** Say that a step is beyond the limits in axes.toml; null if it is not. */
  beyond(steps) {
    const { limits } = this;
    if (!limits || (steps >= limits[0] && steps <= limits[1])) return null;
    const [low, high] = this.settings.limits;
    return `${this.name}: ${this.withUnit(this.short(this.position(steps)))} is beyond its limits of ${low} to ${this.withUnit(String(high))} (axes.toml)`;
  }

  /** A number in this unit, with the decimals of a step. */
  number(value) {
    return (value + 0).toFixed(this.decimals).replace(/^-(0(\.0*)?)$/, "$1");
  }

  /** The same without zeros at its end. */
  short(value) {
    return String(Number(this.number(value)));
  }

  /** A step's position for a narrow place, such as "12.4". */
  brief(steps) {
    const value = this.position(steps);
    return String(Number(value.toFixed(Math.min(this.decimals, Math.abs(value) < 1000 ? 1 : 0))) + 0);
  }

  withUnit(text, per = "") {
    return text + (SIGNS[this.unit] ?? ` ${this.unit}`) + per;
  }

  /** Such as "12.400°", or "31000 steps": as long as other positions of this axis. */
  text(steps) {
    return this.withUnit(this.number(this.position(steps)));
  }

  /** Such as "12.4° (31000)", or "31000". */
  full(steps) {
    return this.scaled ? `${this.withUnit(this.short(this.position(steps)))} (${steps})` : String(steps);
  }

  /** A rate per "s" or "s²", such as "20°/s (5000 steps/s)". */
  fullRate(steps, per) {
    const plain = `${steps} steps/${per}`;
    return this.scaled ? `${this.withUnit(this.short(this.rate(steps)), `/${per}`)} (${plain})` : plain;
  }
}

/** All axes. Events: "change". */
export class Axes extends EventTarget {
  #of = new Map();

  /** Use other settings: an array of axes as in axes.toml. */
  set(list) {
    this.#of = new Map(list.map((settings) => [settings.motor, settings]));
    this.dispatchEvent(new Event("change"));
  }

  /** Every axis in the file, in the order of motors. */
  get list() {
    return [...this.#of.values()].sort((a, b) => a.motor - b.motor);
  }

  of(motor) {
    return new Axis(motor, this.#of.get(motor) ?? null);
  }

  name(motor) {
    return this.of(motor).name;
  }

  /** Such as "pan, tilt", "Motor 3" or "Motors 3, 4". */
  titles(motors) {
    if (motors.some((motor) => this.#of.has(motor))) return motors.map((motor) => this.of(motor).title).join(", ");
    return `Motor${motors.length > 1 ? "s" : ""} ${motors.join(", ")}`;
  }

  /** Put names for numbers of motors into a sentence. */
  named(text) {
    return text.replace(/\b([Mm])otor (\d+)\b/g, (found, first, motor) => this.#of.get(Number(motor))?.name ?? found);
  }
}

// ---- axes.toml

/** A file is not an axes.toml. The text has the line, or the axis and the key. */
export class AxesError extends Error {}

const finite = (value) => typeof value === "number" && Number.isFinite(value);
const word = (value) => typeof value === "string" && value.trim() === value && value !== "";
const unit = (value) => UNITS.includes(value);
const units = `one of ${UNITS.join(", ")}`;
const MOTORS = 32;
const LEAST = 1e-6;
const MOST = 1e9;
const KEYS = {
  name: ["a text", word],
  motor: [`a whole number from 1 to ${MOTORS}`, (value) => Number.isInteger(value) && value >= 1 && value <= MOTORS],
  steps_per_unit: [`a number from ${LEAST} to ${MOST}`, (value) => finite(value) && value >= LEAST && value <= MOST],
  unit: [units, unit],
  in_file: ["a text, or a column's number", (value) => word(value) || (Number.isInteger(value) && value >= 1 && value <= 1e6)],
  zero: ["a number", finite],
  limits: ["two numbers [lowest, highest]", (value) => Array.isArray(value) && value.length === 2 && value.every(finite) && value[0] < value[1]],
  invert: ["true or false", (value) => typeof value === "boolean"],
  file_unit: [units, unit],
  hold: ["a number", finite],
};
const NEEDED = ["name", "motor", "steps_per_unit"];

/** Check axes, and return them. Throws AxesError. */
export function checkAxes(list) {
  list.forEach((axis, at) => {
    const where = `axis ${at + 1}${word(axis.name) ? ` (${axis.name})` : ""}`;
    for (const [key, value] of Object.entries(axis)) {
      if (value === undefined) continue;
      if (!KEYS[key]) throw new AxesError(`${where}: no key “${key}”; there are ${Object.keys(KEYS).join(", ")}`);
      const [allowed, right] = KEYS[key];
      if (!right(value)) throw new AxesError(`${where}: “${key}”: expected ${allowed}, found ${JSON.stringify(value)}`);
    }
    for (const key of NEEDED) if (axis[key] === undefined) throw new AxesError(`${where}: “${key}” is missing: ${KEYS[key][0]}`);
  });
  for (const key of ["motor", "name"]) {
    const values = list.map((axis) => axis[key]);
    const twice = values.find((value, at) => values.indexOf(value) !== at);
    if (twice !== undefined) throw new AxesError(`“${key}”: ${twice} occurs twice`);
  }
  return list;
}

const STRING = /^(?:"(?:[^"\\]|\\.)*"|'[^']*')/;
const NUMBER = /^[+-]?(?:\d[\d_]*)(?:\.\d[\d_]*)?(?:[eE][+-]?\d+)?/;

/** Return a value at the beginning of a text, and the text after it: [value, rest]; null if there is none. */
function valueOf(text) {
  let found = STRING.exec(text)?.[0];
  if (found) {
    try {
      return [found[0] === "'" ? found.slice(1, -1) : JSON.parse(found), text.slice(found.length)];
    } catch {
      return null;
    }
  }
  found = /^(?:true|false)\b/.exec(text)?.[0];
  if (found) return [found === "true", text.slice(found.length)];
  found = NUMBER.exec(text)?.[0];
  if (found) return [Number(found.replaceAll("_", "")), text.slice(found.length)];
  return text[0] === "[" ? arrayOf(text) : null;
}

function arrayOf(text) {
  const values = [];
  let rest = text.slice(1).trimStart();
  while (rest[0] !== "]") {
    const found = valueOf(rest);
    if (!found) return null;
    values.push(found[0]);
    rest = found[1].trimStart();
    if (rest[0] === ",") rest = rest.slice(1).trimStart();
    else if (rest[0] !== "]") return null;
  }
  return [values, rest.slice(1)];
}

const linesOf = (text) => text.replace(/^\uFEFF/, "").split(/\r\n|\n/);
const AXIS = /^\s*\[\[\s*axis\s*\]\]\s*(#.*)?$/;
const CAMERA = /^\s*\[\s*camera\s*\]\s*(#.*)?$/;

/** Return [first line, line after it] of the table [camera], which the page leaves as it is; two equal ones if there is none. */
function cameraLines(lines) {
  const from = lines.findIndex((line) => CAMERA.test(line));
  if (from < 0) return [0, 0];
  const to = lines.findIndex((line, at) => at > from && AXIS.test(line));
  return [from, to < 0 ? lines.length : to];
}

/** Return the text of the table [camera] in an axes.toml, or an empty one. */
export function cameraText(text) {
  const lines = linesOf(text);
  return lines.slice(...cameraLines(lines)).join("\n").trimEnd();
}

/** Return the axes in the text of an axes.toml. Throws AxesError. Each key has to be on a line of its own. */
export function parseAxes(text) {
  const list = [];
  const lines = linesOf(text);
  const [from, to] = cameraLines(lines);
  lines.forEach((line, at) => {
    const bare = line.trim();
    if (bare === "" || bare[0] === "#" || (at >= from && at < to)) return;
    const wrong = () => new AxesError(`line ${at + 1}: expected [[axis]] or a line such as unit = "deg", found “${bare.slice(0, 80)}”`);
    if (AXIS.test(bare)) {
      list.push({});
      return;
    }
    const key = /^([\w-]+)\s*=\s*/.exec(bare);
    const found = key && valueOf(bare.slice(key[0].length));
    if (!found || !list.length || !/^\s*(#.*)?$/.test(found[1]) || Object.hasOwn(list.at(-1), key[1])) throw wrong();
    list.at(-1)[key[1]] = found[0];
  });
  if (!list.length) throw new AxesError("expected an [[axis]] for each motor, found none");
  return checkAxes(list);
}

/** Return the text of an axes.toml. camera: of its table [camera], or empty. */
export function axesText(list, camera = "") {
  const value = (found) => (Array.isArray(found) ? `[${found.join(", ")}]` : JSON.stringify(found));
  return list.map((axis) => ["[[axis]]", ...Object.keys(KEYS).filter((key) => axis[key] !== undefined).map((key) => `${key} = ${value(axis[key])}`), ""].join("\n")).join("\n") + (camera && `\n${camera}\n`);
}
