// The USB controller's double-buffered endpoints as TinyUSB 0.21's driver uses them: both buffers armed, the one that is
// done armed again while the other is in use, and an abort if a short packet ends a transfer early.
// RP2040 datasheet 4.1.2.5 (buffer control), 4.1.2.6 (device), and the registers of 4.1.4.

import assert from 'node:assert/strict';
import { STALL, UsbDevice } from '../lib/usb.mjs';
import { makeCore } from './chip.mjs';

const SET = 2;
const CLEAR = 3;
const SIE_STATUS = 0x50;
const BUFF_STATUS = 0x58;
const BUFF_CPU_SHOULD_HANDLE = 0x5c;
const EP_ABORT = 0x60;
const EP_ABORT_DONE = 0x64;
const TRANS_COMPLETE = 1 << 18;

const FULL = 0x8000;
const LAST = 0x4000;
const DATA1 = 0x2000;
const SELECT = 0x1000;
const AVAILABLE = 0x400;
const DOUBLE = 1 << 30;
const PER_BUFFER = 1 << 29;
const PER_TWO = 1 << 28;
const ENABLE = 2 ** 31;

const ENDPOINT = 2;
const AT = 0x180; // its buffers in the DPRAM
const DPRAM = 0x50100000;

const packet = (length, first) => Uint8Array.from({ length }, (_, i) => (first + i) & 0xff);

/** A controller with one endpoint, and the actions of a driver. */
class Bench {
  constructor(out, mode = DOUBLE | PER_BUFFER) {
    ({ core: this.core } = makeCore({ xipMiss: 0, onHalt: (reason) => assert.fail(reason) }));
    this.chip = this.core.rp2040;
    this.kicks = 0;
    const host = { kick: () => this.kicks++, pullupChanged() {}, sofWanted() {}, inReset: false };
    this.usb = new UsbDevice(this.chip, host);
    this.chip.usbCtrl = this.usb;
    this.out = out;
    this.bit = 1 << (2 * ENDPOINT + (out ? 1 : 0));
    this.word = DPRAM + 0x80 + 8 * ENDPOINT + (out ? 4 : 0);
    this.core.store32(DPRAM + 8 * ENDPOINT + (out ? 4 : 0), (ENABLE | mode | AT) >>> 0);
  }

  arm(first, second = 0) {
    this.core.store32(this.word, first | SELECT | (second << 16));
  }

  armHalf(half, state) {
    this.core.store16(this.word + 2 * half, state);
  }

  /** Half of the word as the driver reads it. */
  half(half) {
    return (this.core.load32(this.word) >>> (16 * half)) & 0xffff;
  }

  /** The next buffer to be handled, which becomes handled; null if there is none. */
  handle() {
    if (!(this.usb.readUint32(BUFF_STATUS) & this.bit)) return null;
    const half = this.usb.readUint32(BUFF_CPU_SHOULD_HANDLE) & this.bit ? 1 : 0;
    this.usb.writeUint32Atomic(BUFF_STATUS, this.bit, CLEAR);
    return half;
  }

  data(half, length) {
    return this.chip.usbDPRAM.slice(AT + 64 * half, AT + 64 * half + length);
  }
}

const tests = {
  'two packets come before the driver looks'() {
    const b = new Bench(true);
    b.arm(AVAILABLE | 64, AVAILABLE | DATA1 | LAST | 64);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(64, 1), 0), true);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(40, 100), 1), true);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(64, 1), 0), null, 'NAK while both are full');
    assert.equal(b.handle(), 0);
    assert.equal(b.half(0), FULL | 64);
    assert.equal(b.handle(), 1, 'the bit is set again at once');
    assert.equal(b.half(1), FULL | LAST | DATA1 | 40, 'which was the last one stays to be seen');
    assert.equal(b.handle(), null);
    assert.deepEqual(b.data(0, 64), packet(64, 1));
    assert.deepEqual(b.data(1, 40), packet(40, 100));
  },

  'from the host, buffers take turns'() {
    const b = new Bench(true);
    b.arm(AVAILABLE | 64, AVAILABLE | DATA1 | 64);
    for (let i = 0; i < 9; i++) {
      const half = i & 1;
      assert.equal(b.usb.giveOut(ENDPOINT, packet(64, i), half), true);
      assert.equal(b.handle(), half);
      assert.deepEqual(b.data(half, 64), packet(64, i));
      assert.ok(b.half(half ^ 1) & AVAILABLE, 'the other one is ready meanwhile');
      const kicks = b.kicks;
      b.armHalf(half, AVAILABLE | (half ? DATA1 : 0) | 64);
      assert.ok(b.kicks > kicks, 'the host learns of it');
    }
  },

  'to the host, buffers take turns'() {
    const b = new Bench(false);
    const fill = (half, i) => b.chip.usbDPRAM.set(packet(64, i), AT + 64 * half);
    fill(0, 0);
    fill(1, 1);
    b.arm(AVAILABLE | FULL | 64, AVAILABLE | FULL | DATA1 | 64);
    for (let i = 0; i < 9; i++) {
      const half = i & 1;
      assert.equal(b.usb.toggle(ENDPOINT), half);
      assert.deepEqual(b.usb.takeIn(ENDPOINT), packet(64, i));
      assert.equal(b.handle(), half);
      assert.ok(!(b.half(half) & (AVAILABLE | FULL)));
      fill(half, i + 2);
      b.armHalf(half, AVAILABLE | FULL | (half ? DATA1 : 0) | 64);
    }
    b.usb.takeIn(ENDPOINT);
    b.usb.takeIn(ENDPOINT);
    assert.equal(b.usb.takeIn(ENDPOINT), null, 'NAK when both are gone');
    assert.deepEqual([b.handle(), b.handle(), b.handle()], [1, 0, null], 'the first one first');
  },

  'a short packet, and the other buffer is taken back'() {
    const b = new Bench(true);
    b.arm(AVAILABLE | 64, AVAILABLE | DATA1 | LAST | 64);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(3, 7), 0), true);
    assert.equal(b.handle(), 0);
    b.usb.writeUint32Atomic(EP_ABORT, b.bit, SET);
    assert.ok(b.usb.readUint32(EP_ABORT_DONE) & b.bit);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(64, 1), 1), null, 'NAK whatever the buffer says');
    assert.equal(b.usb.ready(ENDPOINT, true), false);
    b.core.store32(b.word, 0);
    b.usb.writeUint32Atomic(EP_ABORT_DONE, b.bit, CLEAR);
    b.usb.writeUint32Atomic(EP_ABORT, b.bit, CLEAR);
    assert.equal(b.usb.readUint32(EP_ABORT_DONE) & b.bit, 0);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(64, 1), 1), null);
    b.arm(AVAILABLE | DATA1 | LAST | 64);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(64, 1), 1), true);
    assert.equal(b.handle(), 0, 'the reset of the buffer select holds');
    assert.deepEqual(b.data(0, 64), packet(64, 1));
  },

  'an abort is over: the host is told'() {
    const b = new Bench(true);
    b.arm(AVAILABLE | 64);
    b.usb.writeUint32Atomic(EP_ABORT, b.bit, SET);
    const kicks = b.kicks;
    b.usb.writeUint32Atomic(EP_ABORT, b.bit, CLEAR);
    assert.ok(b.kicks > kicks && b.usb.ready(ENDPOINT, true));
  },

  'the last buffer of a transfer'() {
    for (const out of [true, false]) {
      const b = new Bench(out);
      const full = out ? 0 : FULL;
      const go = () => (out ? b.usb.giveOut(ENDPOINT, packet(64, 0)) : b.usb.takeIn(ENDPOINT));
      b.arm(AVAILABLE | full | 64, AVAILABLE | full | DATA1 | LAST | 64);
      go();
      assert.equal(b.usb.readUint32(SIE_STATUS) & TRANS_COMPLETE, 0);
      go();
      assert.ok(b.usb.readUint32(SIE_STATUS) & TRANS_COMPLETE);
      assert.ok(b.half(1) & LAST && !(b.half(0) & LAST));
      b.usb.writeUint32Atomic(SIE_STATUS, TRANS_COMPLETE, CLEAR);
      assert.equal(b.usb.readUint32(SIE_STATUS) & TRANS_COMPLETE, 0);
    }
  },

  'one interrupt for two buffers'() {
    const b = new Bench(false, DOUBLE | PER_TWO);
    b.arm(AVAILABLE | FULL | 64, AVAILABLE | FULL | DATA1 | 64);
    b.usb.takeIn(ENDPOINT);
    assert.equal(b.handle(), null);
    b.usb.takeIn(ENDPOINT);
    assert.notEqual(b.handle(), null);
    assert.equal(b.handle(), null);
  },

  'a single buffer is always the first'() {
    const b = new Bench(true, PER_BUFFER);
    for (let i = 0; i < 4; i++) {
      b.core.store32(b.word, AVAILABLE | (i & 1 ? DATA1 : 0) | 64);
      assert.equal(b.usb.giveOut(ENDPOINT, packet(64, i), i & 1), true);
      assert.equal(b.usb.giveOut(ENDPOINT, packet(64, i)), null);
      assert.equal(b.handle(), 0);
      assert.equal(b.handle(), null);
    }
    b.core.store32(b.word, 0x800);
    assert.equal(b.usb.giveOut(ENDPOINT, packet(1, 0)), STALL);
  },
};

for (const [name, run] of Object.entries(tests)) {
  try {
    run();
  } catch (error) {
    console.error(`${name}: ${error.message}`);
    process.exitCode = 1;
  }
}
console.log(`${Object.keys(tests).length} tests`);
