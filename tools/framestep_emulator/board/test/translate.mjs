// Translated code does what the interpreter does, to the cycle: random code in RAM and in flash, which ends at random
// limits, and the boot of a whole board.
//
// usage: node translate.mjs BLOCKS FIRMWARE

import assert from 'node:assert';
import fs from 'node:fs';
import { RP2040 } from 'rp2040js';
import { Board } from '../lib/board.mjs';
import { Core } from '../lib/core.mjs';
import { Native } from '../lib/native.mjs';
import { Trace } from '../lib/trace.mjs';

const BLOCKS = Number(process.argv[2]);
const LENGTH = 20; // halfwords, without the loop at the end
const DATA = 0x20001000;
const HERE = 0xe7fe; // a branch to itself

let seed = 20261126;
function pick(n) {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return Math.floor((seed / 2 ** 32) * n);
}
const word = () => (pick(65536) << 16) | pick(65536);
const INTERESTING = [0, 1, 2, 31, 32, 33, 0x7fffffff, 0x80000000 | 0, -2, -1, 255, 256];
const value = () => (pick(3) ? word() : INTERESTING[pick(INTERESTING.length)]);

// r4 to r7 are addresses; the others are results
const low = () => pick(4);
const CLASSES = [
  () => (pick(3) << 11) | ((pick(2) * pick(32)) << 6) | (pick(8) << 3) | low(), // shifts by 0 or more
  () => 0x1800 | (pick(32) << 6) | (pick(8) << 3) | low(), // add, subtract
  () => 0x2000 | (pick(4) << 11) | (low() << 8) | pick(256), // with immediates
  () => 0x4000 | (pick(16) << 6) | (pick(8) << 3) | low(),
  () => 0x4400 | (pick(3) << 8) | (pick(15) << 3) | low(), // high registers
  () => 0x4800 | (low() << 8) | pick(8), // literals: the code
  () => 0x5000 | (pick(8) << 9) | (7 << 6) | ((4 + pick(3)) << 3) | low(), // offset in r7
  () => 0x6000 | (pick(6) << 11) | (pick(32) << 6) | ((4 + pick(3)) << 3) | low(),
  () => 0x9000 | (pick(2) << 11) | (low() << 8) | pick(64),
  () => 0xa000 | (pick(2) << 11) | (low() << 8) | pick(64),
  () => 0xb000 | (pick(2) << 7) | pick(8),
  () => 0xb200 | (pick(4) << 6) | (pick(8) << 3) | low(),
  () => 0xba00 | ([0, 1, 3][pick(3)] << 6) | (pick(8) << 3) | low(),
  () => 0xb400 | (1 + pick(15)), // push
  () => 0xbc00 | (1 + pick(15)), // pop
  () => 0xc000 | (pick(2) << 11) | (4 << 8) | (1 + pick(pick(2) ? 31 : 15)), // store and load multiple, at r4
  () => 0xd000 | (pick(14) << 8) | pick(6), // branches forward
  () => 0xe000 | pick(4),
  () => (pick(2) ? 0xb672 : 0xb662), // CPS, which is left to the interpreter
  () => 0xbf00,
];

function makeCore(native) {
  const chip = new RP2040();
  chip.logger = { debug() {}, info() {}, warn() {}, error() {} };
  if (native) {
    chip.sram = native.ram;
    chip.flash = native.flash;
    native.clear();
  }
  const core = new Core(chip, { native, onHalt: (reason) => (core.why = reason) });
  if (!native) core.attachFlash(new Uint8Array(2 * 1024 * 1024));
  return core;
}

const native = new Native({ hot: 1, batch: 1 });
const cores = [makeCore(null), makeCore(native)];
const flags = (core) => core.APSR >>> 28;
const state = (core) => [...core.r, flags(core), core.cyc, core.PM, core.xipAccesses, core.xipMisses, core.why ?? ''];

native.ramSeen.fill(1);
native.flashSeen.fill(1);

let translated = 0;
for (let block = 0; block < BLOCKS; block++) {
  const inFlash = block % 2;
  const start = (inFlash ? 0x10001000 : 0x20004000) + 128 * (block % 301) + 2 * pick(4);
  const code = Array.from({ length: LENGTH }, () => CLASSES[pick(CLASSES.length)]());
  for (const core of cores) {
    const [memory, at] = inFlash ? [core.flash16, (start & 0xffffff) >> 1] : [core.ram16, (start & 0xffffff) >> 1];
    memory.set([...code, ...Array(12).fill(HERE)], at);
  }
  native.check();
  for (let run = 0; run < 4; run++) {
    const stack = 0x20000000 + (pick(4) ? 0x3000 : 0x42000 - 4 * pick(8));
    const registers = Array.from({ length: 13 }, value);
    for (const n of [4, 5, 6]) registers[n] = (n > 4 && pick(2) ? 0x10001000 : DATA) + 4 * pick(64) + (pick(8) ? 0 : pick(4));
    registers[7] = pick(64);
    const bits = pick(16);
    const limit = 1 + pick(run ? 100 : 40);
    const bytes = Uint8Array.from({ length: 1024 }, () => pick(256));
    for (const core of cores) {
      core.r.set(registers);
      core.r[13] = stack;
      core.r[14] = 0x20000101;
      core.r[15] = start;
      core.ram8.set(bytes, DATA & 0xffffff);
      core.ram8.fill(7, (stack & 0xffffff) - 0x100);
      core.APSR = bits << 28;
      core.xipFlush();
      core.PM = core.halted = core.irqCheck = false;
      core.why = undefined;
      core.sliceEnd = Infinity;
      core.cyc = 0;
      core.limit = core.budget = limit;
      core.interpret();
    }
    if (!native.has(start)) native.count(start);
    const [expected, found] = cores.map(state);
    assert.deepEqual(found, expected, `${code.map((op) => op.toString(16))} at ${start.toString(16)}, limit ${limit}`);
    assert.ok(Buffer.from(cores[0].ram8).equals(cores[1].ram8), `memory after ${code.map((op) => op.toString(16))}`);
  }
  translated += native.has(start);
}
assert.ok(translated > 0.8 * BLOCKS, `only ${translated} of ${BLOCKS} were translated`);

const firmware = fs.readFileSync(process.argv[3]);
const boards = [null, { hot: 50, batch: 8 }].map((translate) => new Board({ firmware, translate }));
for (const board of boards) board.startTrace(new Trace([...Array(30).keys()]));
for (let ns = 0, step = 1; ns < 120e6; ns += step, step = 1 + ((step * 7919) % 300_007)) {
  const seen = boards.map((board) => {
    board.runUntil(ns);
    const { core } = board;
    return [...core.r, flags(core), core.cycles, core.xipAccesses, core.xipMisses, board.clock.nanos, board.events.length];
  });
  assert.deepEqual(seen[1], seen[0], `at ${ns} ns`);
}
const edges = boards.map(({ trace }) => Buffer.from(trace.take()));
assert.ok(edges[0].equals(edges[1]));
assert.ok(Buffer.from(boards[0].core.ram8).equals(boards[1].core.ram8));
assert.ok(boards[1].translated > 100);
console.log(`translate: ${translated} random blocks and ${boards[1].translated} of a board agree with the interpreter`);
