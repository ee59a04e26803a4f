// Pieces of code do what the interpreter does, to the cycle, and both do what an interpreter written by hand did: random code
// in RAM and in flash, which ends at random limits. Then pieces and the interpreter run the boot of a whole board.
//
// usage: node pieces.mjs BLOCKS FIRMWARE

import assert from 'node:assert';
import { createHash } from 'node:crypto';
import fs from 'node:fs';
import { Board } from '../lib/board.mjs';
import { Trace } from '../lib/trace.mjs';
import { makeCore } from './chip.mjs';

const NEVER = 1e9;
/** States after the random blocks, as the interpreter written by hand left them. */
const RECORDED = { blocks: 600, hash: '7816afc6233b3714f7cb2cc582a86c8505e1ef3fe1bdefaf266972ac7c015a1c' };
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

// r4 to r7 are addresses, r8 one of code; the others are results
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
  () => (pick(2) ? 0xb672 : 0xb662), // CPS
  () => [0x4740, 0x47c0, 0x46c7, 0x4487][pick(4)], // BX, BLX, MOV, ADD: jumps to r8 and by r0
  () => [0xf000, 0xf800 | pick(4)], // BL
  () => [0xf3ef, 0x8000 | (low() << 8) | [0, 3, 5, 8, 9, 16, 20][pick(7)]], // MRS
  () => [0xf380 | low(), 0x8800 | [0, 16][pick(2)]], // MSR
  () => [0xf3bf, 0x8f5f], // DMB
  () => (pick(8) ? 0xbf00 : [0xbd01, 0xbf20, 0xbf30, 0xbf40, 0xbe00, 0xdf01, 0xde00, 0xe800, 0xc400, 0xbc00][pick(10)]), // POP to pc, WFE, WFI, SEV, ...
  () => 0xbf00,
];

const cores = [{ hot: NEVER }, { hot: 1, batch: 1 }].map((options) => {
  const { core, native } = makeCore({ ...options, onHalt: (reason) => (core.why ??= reason) });
  return { core, native };
});
const { native } = cores[1];
const flags = (core) => core.APSR >>> 28;
const state = (core) => [
  ...core.r, flags(core), core.cyc, core.PM, core.xipAccesses, core.xipMisses, core.why ?? '', core.waiting, core.eventRegistered, core.pendingSVCall,
];
const seen = createHash('sha256');

let pieces = 0;
for (let block = 0; block < BLOCKS; block++) {
  const inFlash = block % 2;
  const start = (inFlash ? 0x10001000 : 0x20004000) + 128 * (block % 301) + 2 * pick(4);
  const code = Array.from({ length: LENGTH }, () => CLASSES[pick(CLASSES.length)]()).flat();
  for (const { core } of cores) {
    const memory = inFlash ? core.flash16 : core.ram16;
    memory.set([...code, ...Array(24).fill(HERE)], (start & 0xffffff) >> 1);
  }
  native.check();
  native.link([start]);
  for (let run = 0; run < 4; run++) {
    const atEnd = !pick(4); // of the RAM
    const stack = 0x20000000 + (atEnd ? 0x42000 - 4 * pick(8) : 0x3000);
    const registers = Array.from({ length: 13 }, value);
    for (const n of [4, 5, 6]) registers[n] = (n > 4 && pick(2) ? 0x10001000 : DATA) + 4 * pick(64) + (pick(8) ? 0 : pick(4));
    registers[7] = pick(64);
    registers[8] = start + 2 * pick(LENGTH) + 1;
    const bits = pick(16);
    const limit = 1 + pick(run ? 100 : 40);
    const bytes = Uint8Array.from({ length: 1024 }, () => pick(256));
    for (const { core } of cores) {
      core.r.set(registers);
      core.r[13] = stack;
      core.r[14] = 0x20000101;
      core.r[15] = start;
      core.ram8.set(bytes, DATA & 0xffffff);
      core.ram8.fill(7, (stack & 0xffffff) - 0x100, (stack & 0xffffff) + 0x100);
      core.APSR = bits << 28;
      core.xipFlush();
      core.PM = core.halted = core.irqCheck = core.eventRegistered = core.pendingSVCall = false;
      core.waiting = core.xipAccesses = core.xipMisses = 0;
      core.why = undefined;
      core.sliceEnd = Infinity;
      core.cyc = 0;
      core.limit = core.budget = limit;
      core.execute();
    }
    const [expected, found] = cores.map(({ core }) => state(core));
    const [memory, other] = cores.map(({ core }) => Buffer.from(core.ram8));
    assert.deepEqual(found, expected, `${code.map((op) => op.toString(16))} at ${start.toString(16)}, limit ${limit}`);
    assert.ok(memory.equals(other), `memory after ${code.map((op) => op.toString(16))}`);
    if (!atEnd) seen.update(JSON.stringify(expected).replace(/pc 0x.*?, /, '')).update(memory.subarray(0x1000, 0x4000));
  }
  pieces += native.has(start);
}
assert.ok(pieces > 0.8 * BLOCKS, `only ${pieces} pieces of ${BLOCKS}`);
if (BLOCKS === RECORDED.blocks) assert.equal(seen.digest('hex'), RECORDED.hash);

const firmware = fs.readFileSync(process.argv[3]);
const boards = [{ hot: NEVER }, { hot: 50, batch: 8 }].map((options) => new Board({ firmware, native: options }));
for (const board of boards) board.startTrace(new Trace([...Array(30).keys()]));
for (let ns = 0, step = 1; ns < 120e6; ns += step, step = 1 + ((step * 7919) % 300_007)) {
  const found = boards.map((board) => {
    board.runUntil(ns);
    const { core } = board;
    return [...core.r, flags(core), core.cycles, core.xipAccesses, core.xipMisses, board.clock.nanos, board.events.length];
  });
  assert.deepEqual(found[1], found[0], `at ${ns} ns`);
}
const edges = boards.map(({ trace }) => Buffer.from(trace.take()));
assert.ok(edges[0].equals(edges[1]));
assert.ok(Buffer.from(boards[0].core.ram8).equals(boards[1].core.ram8));
assert.ok(boards[1].pieces > 100);
console.log(`pieces: ${pieces} of random blocks and ${boards[1].pieces} of a board agree with the interpreter`);
