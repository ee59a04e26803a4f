// An edge trace in a file, which can be followed while it is written.

import fs from 'node:fs';
import { Trace } from './trace.mjs';

const FLUSH_MS = 10; // real time; the event loop runs at least every 20 ms

export class FileTrace extends Trace {
  constructor(pins, file) {
    super(pins);
    this.fd = fs.openSync(file, 'w');
    this.timer = setInterval(() => this.flush(), FLUSH_MS).unref();
  }

  write(records) {
    fs.writeSync(this.fd, records);
  }

  close() {
    clearInterval(this.timer);
    super.close();
    fs.closeSync(this.fd);
  }
}
