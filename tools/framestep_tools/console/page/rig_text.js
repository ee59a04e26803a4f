// A rig file's text for the board, and its check by the schema.

import { LinkError } from "./client.js";
import { DRIVER_NEEDS } from "./protocol.js";

/** Return the text without // comments and byte order mark. Throws LinkError, with the mistake, if the rest is not a JSON
 * object. */
export function bareRig(text) {
  const bare = text.replace(/^\uFEFF/, "").replace(/("(?:[^"\\\n]|\\.)*")|\/\/[^\n]*/g, (_, string) => string ?? "")
    .replace(/[ \t]+$/gm, "").replace(/\n{2,}/g, "\n").trim();
  let found;
  try {
    found = JSON.parse(bare);
  } catch (error) {
    throw new LinkError(`rig.json: not valid JSON (${error.message})`);
  }
  if (typeOf(found) !== "object") throw new LinkError("rig.json: expected an object of settings in {…}");
  return `${bare}\n`;
}

/** Return the first mistake that a schema (rig.schema.json) finds in a value, as text with its key, or null. */
export function mistake(value, schema, where = "") {
  const wrong = (what) => `${where}: found ${JSON.stringify(value)}, allowed is ${what}`;
  const type = typeOf(value);
  if (type !== schema.type && !(schema.type === "number" && type === "integer")) return wrong(allowed(schema));
  if (schema.enum && !schema.enum.includes(value)) return wrong(allowed(schema));
  if (schema.minimum !== undefined && (value < schema.minimum || value > schema.maximum)) return wrong(allowed(schema));
  if (type === "string" && schema.maxLength !== undefined) {
    const bytes = new TextEncoder().encode(value).length;
    if (bytes < schema.minLength || bytes > schema.maxLength) return wrong(allowed(schema));
  }
  if (type === "array") return inList(value, schema, where);
  return type === "object" ? inObject(value, schema, where) : null;
}

/** Return a sentence for each key of a rig file without mistakes that is less than what the motor's type of driver needs. */
export function warnings({ motors = [] }) {
  return motors.flatMap((motor, i) => Object.entries(DRIVER_NEEDS[motor.type] ?? {})
    .filter(([key, [least]]) => motor[key] < least)
    .map(([key, [least, unit]]) => `motors[${i + 1}].${key}: ${motor[key]} ${unit} is less than the ${least} ${unit} that a driver of type ${motor.type} needs`));
}

/** Return the allowed values of a setting as text. */
export function allowed({ type, enum: choices, minimum, maximum, minLength, maxLength, maxItems }) {
  if (choices) return choices.map((choice) => JSON.stringify(choice)).join(", ");
  if (minimum !== undefined) return `${minimum} to ${maximum}`;
  if (maxLength !== undefined) return `${minLength} to ${maxLength} bytes of text`;
  if (maxItems !== undefined) return `a list of at most ${maxItems}`;
  return { boolean: "true, false", array: "a list", object: "an object" }[type] ?? type;
}

function typeOf(value) {
  if (value === null) return "null";
  if (Array.isArray(value)) return "array";
  return Number.isInteger(value) ? "integer" : typeof value;
}

function inList(value, schema, where) {
  if (value.length > schema.maxItems) return `${where}: found ${value.length}, allowed is ${allowed(schema)}`;
  return first(value.map((each, i) => () => mistake(each, schema.items ?? {}, `${where}[${i + 1}]`)));
}

function inObject(value, { properties = {}, required = [] }, where) {
  const key = (name) => (where ? `${where}.${name}` : name);
  const unknown = Object.keys(value).find((name) => !Object.hasOwn(properties, name));
  if (unknown !== undefined) return `${key(unknown)}: no such setting; there are ${Object.keys(properties).join(", ")}`;
  const missing = required.find((name) => !Object.hasOwn(value, name));
  if (missing !== undefined) return `${key(missing)}: is missing, expected is ${allowed(properties[missing])}`;
  return first(Object.entries(value).map(([name, each]) => () => mistake(each, properties[name], key(name))));
}

function first(looks) {
  for (const look of looks) {
    const found = look();
    if (found) return found;
  }
  return null;
}
