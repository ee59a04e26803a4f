// The timer as other firmware than MicroPython uses it: another rate (WATCHDOG.TICK, RP2040 datasheet 4.7.2), and a value
// written to the counter (4.6).

import assert from 'node:assert/strict';
import { Timer, extendWatchdog } from '../lib/periph.mjs';
import { Clock } from '../lib/clock.mjs';

const ENABLE = 1 << 9;
const RUNNING = 1 << 10;
const TICK = 0x2c;
const TIMEHW = 0x00;
const TIMELW = 0x04;
const ALARM0 = 0x10;
const TIMERAWH = 0x24;
const TIMERAWL = 0x28;
const INTR = 0x34;

const clock = new Clock();
const chip = { clock, setInterrupt() {}, logger: { debug() {}, info() {}, warn() {}, error() {} } };
const timer = new Timer(chip);
const watchdog = { readUint32: () => 0, writeUint32() {}, timer: { frequency: 2e6 } };
extendWatchdog(watchdog, timer);
const low = () => timer.readUint32(TIMERAWL);
/** Let time pass, in ns. */
const pass = (ns) => {
  const until = clock.nanosCounter + ns;
  clock.fireUntil(until);
  clock.nanosCounter = until;
};
let checked = 0;
const equal = (found, expected) => {
  assert.equal(found, expected);
  checked++;
};

pass(1_000_000);
equal(low(), 1000);
watchdog.writeUint32(TICK, 12 | ENABLE);
pass(1_000_000);
equal(low(), 2000);
equal(watchdog.readUint32(TICK), 12 | ENABLE | RUNNING);
timer.writeUint32(ALARM0, 2000 + 12_000);
watchdog.writeUint32(TICK, 1 | ENABLE); // 12 MHz, as Klipper's firmware sets it
equal(watchdog.timer.frequency, 24e6);
pass(999_900);
equal(timer.readUint32(INTR), 0);
pass(200);
equal(timer.readUint32(INTR), 1); // an armed alarm keeps its value
equal(low(), 2000 + 12_001);
watchdog.writeUint32(TICK, 0);
const stopped = low();
pass(5_000_000);
equal(low(), stopped);
watchdog.writeUint32(TICK, 12 | ENABLE);
timer.writeUint32(TIMELW, 0xfffffff0);
equal(low(), stopped); // takes effect with the high word
timer.writeUint32(TIMEHW, 5);
equal(low(), 0xfffffff0);
pass(32_000);
equal(low(), 16);
equal(timer.readUint32(TIMERAWH), 6);
console.log(checked, 'checks');
