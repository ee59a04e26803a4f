// Edge trace of GPIO pins: records of 10 bytes, little endian: u64 nanoseconds, u8 pin, u8 level.
// A pin's level when the trace starts is recorded as an edge at that moment.

import fs from 'node:fs';

export const RECORD = 10;
const CHUNK = 65536 * RECORD;
const FLUSH_MS = 10; // real time; the event loop itself comes round every 20 ms at the latest

export class Trace {
  /** @param file where the records go; kept in memory and handed out by `take` when there is none */
  constructor(pins, file = null) {
    this.mask = pins.reduce((bits, pin) => bits | (1 << pin), 0);
    this.fd = file ? fs.openSync(file, 'w') : -1;
    this.full = [];
    this.buffer = Buffer.alloc(CHUNK);
    this.used = 0;
    this.count = 0;
    // a file can be followed while it is written
    if (file) this.timer = setInterval(() => this.flush(), FLUSH_MS).unref();
  }

  add(nanos, pin, level) {
    if (!((this.mask >>> pin) & 1)) return;
    const time = Math.round(nanos);
    const { buffer, used } = this;
    buffer.writeUInt32LE(time % 0x100000000, used);
    buffer.writeUInt32LE(Math.floor(time / 0x100000000), used + 4);
    buffer[used + 8] = pin;
    buffer[used + 9] = level ? 1 : 0;
    this.used += RECORD;
    this.count++;
    if (this.used === CHUNK) this.flush();
  }

  flush() {
    if (!this.used) return;
    if (this.fd >= 0) fs.writeSync(this.fd, this.buffer, 0, this.used);
    else this.full.push(Buffer.from(this.buffer.subarray(0, this.used)));
    this.used = 0;
  }

  /** The records collected since the last call. */
  take() {
    this.flush();
    const all = Buffer.concat(this.full);
    this.full = [];
    return all;
  }

  close() {
    clearInterval(this.timer);
    this.flush();
    if (this.fd >= 0) fs.closeSync(this.fd);
    this.fd = -1;
  }
}
