// Chips with this emulator's cores: rp2040js' one, and what an RP2350's core needs of one.

import { RP2040 } from 'rp2040js';
import { Core } from '../lib/core.mjs';
import { Native } from '../lib/native.mjs';
import { M33 } from '../lib/rp2350/m33.mjs';
import { Native2350 } from '../lib/rp2350/native.mjs';

export const QUIET = { debug() {}, info() {}, warn() {}, error() {} };

/** Return a core; `options` are those of Core and of Native. */
export function makeCore(options = {}) {
  const chip = new RP2040();
  chip.logger = QUIET;
  const native = new Native(options);
  native.attach(chip);
  chip.core = new Core(chip, { ...options, native });
  return { core: chip.core, native };
}

/** Return a core of an RP2350 on a Native2350, which may have been another one's. */
export function makeM33({ native = new Native2350(), ...options } = {}) {
  const chip = {
    clock: { nanosCounter: 0, nextNanos: Infinity, createAlarm: () => ({ cancel() {} }), fireUntil() {} },
    readPeripheral: () => 0,
    writePeripheral() {},
    sio: { readUint32: () => 0, writeUint32() {} },
    qmi: { first: 44, next: 16, cooldown: 64 },
    bootrom: new Uint32Array(0x2000),
    usbDPRAM: new Uint8Array(4096),
  };
  native.attach(chip);
  return { core: new M33(chip, { ...options, native }), native };
}
