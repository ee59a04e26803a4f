// Edge trace of GPIO pins: records of 10 bytes, little endian: u64 nanoseconds, u8 pin, u8 level.
// A pin's level when the trace starts is recorded as an edge at that moment.

import { concat } from './bytes.mjs';

export const RECORD = 10;
const CHUNK = 65536 * RECORD;

/** Keeps the records until `take` returns them. */
export class Trace {
  constructor(pins) {
    this.pins = pins;
    this.wanted = new Uint8Array(256);
    for (const pin of pins) this.wanted[pin] = 1;
    this.full = [];
    this.buffer = new Uint8Array(CHUNK);
    this.view = new DataView(this.buffer.buffer);
    this.used = 0;
    this.count = 0;
  }

  add(nanos, pin, level) {
    if (!this.wanted[pin]) return;
    const time = Math.round(nanos);
    const { buffer, view, used } = this;
    view.setUint32(used, time % 0x100000000, true);
    view.setUint32(used + 4, Math.floor(time / 0x100000000), true);
    buffer[used + 8] = pin;
    buffer[used + 9] = level ? 1 : 0;
    this.used += RECORD;
    this.count++;
    if (this.used === CHUNK) this.flush();
  }

  flush() {
    if (!this.used) return;
    this.write(this.buffer.subarray(0, this.used));
    this.used = 0;
  }

  /** @param records the buffer's own, which is used again */
  write(records) {
    this.full.push(records.slice());
  }

  /** The records collected since the last call. */
  take() {
    this.flush();
    const all = concat(this.full);
    this.full = [];
    return all;
  }

  close() {
    this.flush();
  }
}
