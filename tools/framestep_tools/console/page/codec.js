// Frames of the DMC v2 protocol: checksum, encoder, decoder; and payloads, by the layouts in protocol.js. This file
// knows no message itself.

import { M, REPORTS, REQUESTS } from "./protocol.js";

const MARK_D = 0x44;
const MARK_F = 0x46;
const CHECK_BYTES = 2;
const LARGEST_ANNOUNCED = 4096; // a longer payload counts as noise

const SIZES = { B: 1, b: 1, H: 2, h: 2, I: 4, i: 4 };
const RANGES = {
  B: [0, 255],
  b: [-128, 127],
  H: [0, 65535],
  h: [-32768, 32767],
  I: [0, 4294967295],
  i: [-2147483648, 2147483647],
};

/** Return Fletcher-16 with modulus 255: [sum1, sum2], both 0 over a whole undamaged frame. */
export function sums(bytes) {
  let one = 0;
  let two = 0;
  for (const byte of bytes) {
    one = (one + byte) % 255;
    two = (two + one) % 255;
  }
  return [one, two];
}

/** Return the bytes of one frame. */
export function encode(type, payload, id) {
  const frame = new Uint8Array(M.FRAME_OVERHEAD + payload.length);
  const view = new DataView(frame.buffer);
  frame[0] = MARK_D;
  frame[1] = MARK_F;
  view.setUint32(2, id, true);
  view.setUint16(6, type, true);
  view.setUint16(8, payload.length, true);
  frame.set(payload, M.HEADER_BYTES);
  const [one, two] = sums(frame.subarray(0, frame.length - CHECK_BYTES));
  const first = 255 - ((one + two) % 255);
  frame[frame.length - 2] = first;
  frame[frame.length - 1] = 255 - ((one + first) % 255);
  return frame;
}

/** Finds frames in a stream of bytes, however it is divided. After a damaged frame it goes on behind the marker. */
export class Decoder {
  #waiting = new Uint8Array(0);

  /** Return the frames {id, type, ack, payload} that these bytes complete. */
  feed(bytes) {
    const all = new Uint8Array(this.#waiting.length + bytes.length);
    all.set(this.#waiting);
    all.set(bytes, this.#waiting.length);
    const found = [];
    let at = 0;
    while (all.length - at >= M.HEADER_BYTES) {
      if (all[at] !== MARK_D || all[at + 1] !== MARK_F) {
        at += 1;
        continue;
      }
      const view = new DataView(all.buffer, at);
      const length = view.getUint16(8, true);
      const size = length + M.FRAME_OVERHEAD;
      if (length <= LARGEST_ANNOUNCED && all.length - at < size) break;
      const frame = all.subarray(at, at + size);
      if (length > LARGEST_ANNOUNCED || sums(frame).some((sum) => sum !== 0)) {
        at += 2;
        continue;
      }
      const type = view.getUint16(6, true);
      found.push({
        id: view.getUint32(2, true),
        type: type & ~M.MSG_FLAG_ACK,
        ack: (type & M.MSG_FLAG_ACK) !== 0,
        payload: frame.slice(M.HEADER_BYTES, M.HEADER_BYTES + length),
      });
      at += size;
    }
    this.#waiting = all.slice(at);
    return found;
  }
}

function put(out, code, value, name) {
  const [least, most] = RANGES[code];
  if (!Number.isInteger(value) || value < least || value > most) {
    throw new RangeError(`${name}: ${least} to ${most} is allowed, found ${value}`);
  }
  for (let i = 0; i < SIZES[code]; i += 1) out.push((value >> (8 * i)) & 255);
}

function packFields(out, fields, values, owner) {
  for (const [name, code, optional] of fields) {
    const value = values[name];
    if (value === undefined && optional) continue;
    if (Array.isArray(code)) {
      for (const record of value ?? []) packFields(out, code, record, `${owner}.${name}`);
    } else if (code[0] === "*") {
      for (const each of value ?? []) put(out, code[1], each, `${owner}.${name}`);
    } else {
      put(out, code, value ?? 0, `${owner}.${name}`);
    }
  }
}

/** Return a request's payload, as in pack("MotorMove", {motor: 1, position: -5}). Throws RangeError if a value does not fit. */
export function pack(request, values) {
  const out = [];
  packFields(out, REQUESTS[request].fields, values, request);
  return Uint8Array.from(out);
}

function get(view, at, code) {
  switch (code) {
    case "B": return view.getUint8(at);
    case "H": return view.getUint16(at, true);
    case "h": return view.getInt16(at, true);
    case "I": return view.getUint32(at, true);
    default: return view.getInt32(at, true);
  }
}

function text(view, at, size) {
  const bytes = new Uint8Array(view.buffer, view.byteOffset + at, size);
  const end = bytes.indexOf(0);
  return new TextDecoder().decode(end < 0 ? bytes : bytes.subarray(0, end));
}

function unpackFields(view, at, fields) {
  const found = {};
  let place = at;
  for (const [name, code, optional] of fields) {
    if (optional && place >= view.byteLength) continue;
    if (Array.isArray(code)) {
      found[name] = [];
      while (place < view.byteLength) {
        const [record, next] = unpackFields(view, place, code);
        found[name].push(record);
        place = next;
      }
    } else if (code[0] === "*") {
      found[name] = [];
      for (; place < view.byteLength; place += SIZES[code[1]]) found[name].push(get(view, place, code[1]));
    } else if (code.endsWith("s")) {
      const size = Number(code.slice(0, -1));
      found[name] = text(view, place, size);
      place += size;
    } else {
      found[name] = get(view, place, code);
      place += SIZES[code];
    }
  }
  return [found, place];
}

/** Decode a report to {kind: "Positions", …}, or null if it is unknown or too short. */
export function unpack(type, payload) {
  const report = REPORTS[type];
  if (!report) return null;
  try {
    const view = new DataView(payload.buffer, payload.byteOffset, payload.byteLength);
    return { kind: report.name, ...unpackFields(view, 0, report.fields)[0] };
  } catch (error) {
    if (error instanceof RangeError) return null;
    throw error;
  }
}

/** Return the code of an acknowledgement: a WORD, or the low word of a DWORD in the dmc-lite dialect. */
export function ackCode(payload) {
  return payload.length >= 2 ? payload[0] | (payload[1] << 8) : -1;
}
