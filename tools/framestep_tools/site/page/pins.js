// The last edges of the board's pins, and the steps so far.

const RECORD = 10; // bytes (tools/framestep_emulator/board/lib/trace.mjs)
const KEPT = 1 << 17; // edges of each pin; a motor at 20 000 steps/s makes them in three seconds

/** The last edges of one pin. `count` never wraps; edges from `count - KEPT` on are kept. */
class Edges {
  count = 0;
  #times = null;
  #levels = null;

  add(nanos, level) {
    this.#times ??= new Float64Array(KEPT);
    this.#levels ??= new Uint8Array(KEPT);
    const at = this.count % KEPT;
    this.#times[at] = nanos;
    this.#levels[at] = level;
    this.count += 1;
  }

  time(index) {
    return this.#times[index % KEPT];
  }

  /** Return the level after an edge; 0 before the first. */
  level(index) {
    return index < 0 ? 0 : this.#levels[index % KEPT];
  }

  /** Return the number of edges up to a time. from: start of the search. */
  upTo(nanos, from = 0) {
    let low = Math.max(from, this.count - KEPT, 0);
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (this.time(middle) <= nanos) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

export class Pins {
  /** Board time in ns up to which the edges are complete. */
  nanos = 0;
  edges;
  /** Steps of each motor since power-up, up minus down. */
  steps;
  #motorOf = new Map(); // step pin -> index of the motor
  #dir;

  /** pins: how many the board has; step, dir: those of the motors. */
  constructor(board, { pins, step, dir }) {
    this.edges = Array.from({ length: pins }, () => new Edges());
    this.steps = step.map(() => 0);
    this.#dir = dir;
    step.forEach((pin, motor) => this.#motorOf.set(pin, motor));
    board.addEventListener("edges", ({ detail }) => this.#take(detail));
  }

  level(pin) {
    const edges = this.edges[pin];
    return edges.level(edges.count - 1);
  }

  #take({ records, nanos }) {
    const view = new DataView(records.buffer);
    for (let at = 0; at < records.length; at += RECORD) {
      const pin = records[at + 8];
      const level = records[at + 9];
      if (level === this.level(pin)) continue;
      this.edges[pin].add(view.getUint32(at, true) + view.getUint32(at + 4, true) * 0x1_0000_0000, level);
      const motor = level ? this.#motorOf.get(pin) : undefined;
      if (motor !== undefined) this.steps[motor] += this.level(this.#dir[motor]) ? 1 : -1;
    }
    this.nanos = nanos;
  }
}
