// The bus as a device sees it whose short answers interleave with what it receives: each transaction takes its own time.
// And a device whose control endpoint has packets of 16 bytes.

import assert from 'node:assert/strict';
import { Clock } from '../lib/clock.mjs';
import { UsbHost } from '../lib/usbhost.mjs';

const PACKET = 16; // bytes of a control packet

const DEVICE = Uint8Array.of(18, 1, 0, 2, 2, 0, 0, PACKET, 1, 2, 3, 4, 0, 1, 0, 0, 0, 1);
const CONFIGURATION = Uint8Array.of(
  9, 2, 48, 0, 2, 1, 0, 0x80, 50,
  9, 4, 0, 0, 1, 2, 2, 0, 0,
  7, 5, 0x81, 3, 8, 0, 10,
  9, 4, 1, 0, 2, 10, 0, 0, 0,
  7, 5, 0x82, 2, 64, 0, 0,
  7, 5, 0x02, 2, 64, 0, 0,
);

/** A device that takes whatever comes, and has an answer of 5 bytes 20 us after each packet, while the next one is on the bus. */
class Device {
  constructor() {
    this.deaf = false;
    this.answers = []; // when they are ready, ns
    this.received = 0;
    this.toggles = 0;
  }

  busReset() {}
  lineChanged() {}
  startOfFrame() {}

  setup(packet) {
    const kind = packet[1] === 6 ? packet[3] : 0;
    const whole = kind === 1 ? DEVICE : kind === 2 ? CONFIGURATION : new Uint8Array(0);
    this.rest = whole.subarray(0, packet[6] | (packet[7] << 8));
  }

  ready(endpoint, out) {
    return endpoint === 0 || out || this.answers[0] <= clock.nanos;
  }

  buffer() {
    return { state: 5 };
  }

  toggle() {
    return this.toggles & 1;
  }

  takeIn(endpoint) {
    if (endpoint === 0) {
      const packet = this.rest.subarray(0, PACKET);
      this.rest = this.rest.subarray(PACKET);
      return packet;
    }
    this.answers.shift();
    this.toggles++;
    return new Uint8Array(5);
  }

  giveOut(endpoint, data) {
    if (endpoint) {
      this.received += data.length;
      this.answers.push(clock.nanos + 20_000);
    }
    return true;
  }
}

const clock = new Clock();
const pass = (ns) => {
  const until = clock.nanosCounter + ns;
  clock.fireUntil(until);
  clock.nanosCounter = until;
};
const events = [];
const host = new UsbHost(clock, 1, (type) => events.push(type));
const device = (host.device = new Device());
host.ports[0].open = true;
host.pullupChanged(true);
pass(100e6);
assert.ok(events.includes('usb-configured'), `enumerated: ${events}`);

host.ports[0].write(new Uint8Array(64 * 1000));
pass(20e6);
// a packet takes 53.9 us on the bus, an answer 12.6
const rate = device.received / 0.02;
assert.ok(rate > 950_000 && rate < 970_000, `${rate} bytes/s, 962 000 expected`);
console.log(`${rate} bytes/s`);
