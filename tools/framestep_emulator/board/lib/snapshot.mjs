// The whole state of some objects, and of everything to which they refer, to be restored in the same objects.
// Functions are not searched: what changes must not be in a closure (test/snapshot.mjs looks for that).

import { createHash } from 'node:crypto';

const isData = (object, key) => 'value' in Reflect.getOwnPropertyDescriptor(object, key);
const bytesOf = (view) => new Uint8Array(view.buffer, view.byteOffset, view.byteLength);

const BYTES = {
  keep: (view) => bytesOf(view).slice(),
  inside: () => [],
  restore: (view, bytes) => bytesOf(view).set(bytes),
};

// By the result of Object.prototype.toString
const KINDS = {
  Object: {
    keep: (object) => Reflect.ownKeys(object).filter((key) => isData(object, key)).map((key) => [key, object[key]]),
    inside: (entries) => entries.map(([, value]) => value),
    restore(object, entries) {
      // Unchanged fields are not assigned: V8 treats fields that nobody assigns to as constants
      for (const [key, value] of entries) if (!Object.is(object[key], value)) object[key] = value;
      const known = new Set(entries.map(([key]) => key));
      for (const key of Reflect.ownKeys(object)) if (!known.has(key) && isData(object, key)) delete object[key];
    },
  },
  Array: {
    keep: (array) => array.slice(),
    inside: (values) => values,
    restore(array, values) {
      array.length = values.length;
      for (let i = 0; i < values.length; i++) if (!Object.is(array[i], values[i])) array[i] = values[i];
    },
  },
  Map: {
    keep: (map) => [...map],
    inside: (entries) => entries.flat(),
    restore(map, entries) {
      map.clear();
      for (const [key, value] of entries) map.set(key, value);
    },
  },
  Set: {
    keep: (set) => [...set],
    inside: (values) => values,
    restore(set, values) {
      set.clear();
      for (const value of values) set.add(value);
    },
  },
  Date: { keep: () => null, inside: () => [], restore() {} }, // of the clock chip, which does not change it
};

function kindOf(object) {
  if (ArrayBuffer.isView(object)) return BYTES;
  const name = Object.prototype.toString.call(object).slice(8, -1);
  // such as the generator that enumerates a USB device
  if (!KINDS[name]) throw new Error(`a ${name} cannot be kept`);
  return KINDS[name];
}

export class Snapshot {
  constructor(...roots) {
    this.kept = []; // [object, kind, state]
    const seen = new Set();
    const pieces = new Map(); // by their memory
    const left = roots;
    while (left.length) {
      const object = left.pop();
      if (object === null || typeof object !== 'object' || seen.has(object)) continue;
      seen.add(object);
      const kind = kindOf(object);
      if (kind === BYTES) {
        // one view of a piece of memory is enough
        const { buffer, byteOffset, byteLength } = object;
        if (!pieces.has(buffer)) pieces.set(buffer, new Set());
        const piece = `${byteOffset} ${byteLength}`;
        if (pieces.get(buffer).has(piece)) continue;
        pieces.get(buffer).add(piece);
      }
      const state = kind.keep(object);
      this.kept.push([object, kind, state]);
      left.push(...kind.inside(state));
    }
  }

  restore() {
    for (const [object, kind, state] of this.kept) kind.restore(object, state);
  }
}

/** A hash of the whole state of some objects: their content and how they refer to each other. */
export function digest(...roots) {
  const hash = createHash('sha256');
  const places = new Map();
  const tell = (value) => {
    if (value === null || typeof value !== 'object') {
      hash.update(`${typeof value} ${typeof value === 'function' ? value.name : Object.is(value, -0) ? '-0' : String(value)};`);
      return;
    }
    if (!places.has(value)) places.set(value, places.size);
    hash.update(`@${places.get(value)};`);
  };
  roots.forEach(tell);
  for (const object of places.keys()) {
    // objects found here come later in this loop
    const kind = kindOf(object);
    hash.update(`${object.constructor?.name}:`);
    if (kind === BYTES) hash.update(bytesOf(object));
    else if (kind === KINDS.Date) tell(object.getTime());
    else if (kind === KINDS.Object) kind.keep(object).sort(([a], [b]) => (String(a) < String(b) ? -1 : 1)).flat().forEach(tell);
    else kind.inside(kind.keep(object)).forEach(tell);
  }
  return hash.digest('hex');
}
