// Lists of steps and functions of an RP2350's code do, to the cycle, what JavaScript made of the same instructions did: random code in RAM and in
// flash, which ends at random limits and goes on, some of it after an exception. Then both run the boot of a whole board.
//
// usage: node pieces33.mjs BLOCKS FIRMWARE

import assert from 'node:assert';
import { createHash } from 'node:crypto';
import fs from 'node:fs';
import { Pico2 } from '../lib/rp2350/board.mjs';
import { Trace } from '../lib/trace.mjs';
import { makeM33 } from './chip.mjs';

const NEVER = 1 << 30;
/** Of the states after the random blocks, as the JavaScript left them. */
const RECORDED = { blocks: 200, hash: '53875e3147824ccd7c66eaab10b6f84c643be0778d2c5afa949a9da8763377ff' };
const BLOCKS = Number(process.argv[2]);
const LENGTH = 60; // instructions
const DATA = 0x20001000;
const STACK = 0x20003000;
const HERE = 0xe7fe; // a branch to itself
const BX_LR = 0x4770;
const VECTORS = 0x20002000;
const HANDLER = 0x20002100; // ADDS r0, LDR r1 from the stack, BX LR
const EXCEPTION = 20;

let seed = 20261129;
function pick(n) {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return Math.floor((seed / 2 ** 32) * n);
}
const word = () => (pick(65536) << 16) | pick(65536);
const INTERESTING = [0, 1, 2, 31, 32, 33, 0x7fffffff, 0x80000000 | 0, -2, -1, 255, 256];
const value = () => (pick(3) ? word() : INTERESTING[pick(INTERESTING.length)]);

// r4 to r6 are addresses, r7 an offset, r8 an address of code; the others are results
const low = () => pick(4);
const base = () => 4 + pick(3);
const flags = () => pick(2) << 4;
const NARROW = [
  () => (pick(3) << 11) | ((pick(2) * pick(32)) << 6) | (pick(8) << 3) | low(),
  () => 0x1800 | (pick(32) << 6) | (pick(8) << 3) | low(),
  () => 0x2000 | (pick(4) << 11) | (low() << 8) | pick(256),
  () => 0x4000 | (pick(16) << 6) | (pick(8) << 3) | low(),
  () => 0x4400 | (pick(3) << 8) | (pick(15) << 3) | low(),
  () => 0x5000 | (pick(8) << 9) | (7 << 6) | (base() << 3) | low(),
  () => 0x6000 | (pick(6) << 11) | (pick(32) << 6) | (base() << 3) | low(),
  () => 0x9000 | (pick(2) << 11) | (low() << 8) | pick(64),
  () => 0xb200 | (pick(4) << 6) | (pick(8) << 3) | low(),
];
const narrow = () => NARROW[pick(NARROW.length)]();
const d = () => (low() << 8) | low();
const CLASSES = [
  ...NARROW,
  ...NARROW,
  () => 0x4800 | (low() << 8) | pick(8), // literals: the code
  () => 0xa000 | (pick(2) << 11) | (low() << 8) | pick(64),
  () => 0xb400 | (1 + pick(15)),
  () => 0xbc00 | (1 + pick(15)),
  () => 0xc000 | (pick(2) << 11) | (4 << 8) | (1 + pick(15)),
  () => 0xd000 | (pick(14) << 8) | pick(8), // branches forward
  () => 0xd000 | (pick(14) << 8) | pick(8),
  () => 0xb100 | (pick(2) << 11) | (pick(6) << 3) | low(), // CBZ, CBNZ
  () => 0xe000 | pick(4),
  () => [0x4740, 0x47c0, 0x46c7][pick(3)], // BX, BLX, MOV to r8
  () => [0xbf00 | (pick(14) << 4) | 8, narrow()], // IT
  () => [0xbf00 | (pick(14) << 4) | 8, ...[[0xbf40], [0xdf01], [0xf380, 0x8800], [0xb662]][pick(4)]], // SEV, SVC, MSR, CPS
  () => [0xbf00 | (2 * pick(7) << 4) | [2, 6, 10, 14][pick(4)], narrow(), narrow(), narrow()],
  () => [0xf000 | (pick(2) << 10) | ([0, 1, 2, 3, 4, 8, 10, 11, 13, 14][pick(10)] << 5) | flags() | low(), (pick(8) << 12) | (low() << 8) | pick(256)],
  () => [0xea00 | ([0, 1, 2, 3, 4, 8, 10, 11, 13, 14][pick(10)] << 5) | flags() | low(), (pick(8) << 12) | (pick(4) << 6) | (pick(4) << 4) | d()],
  () => [[0xf240, 0xf2c0][pick(2)] | (pick(2) << 10) | pick(16), (pick(8) << 12) | (low() << 8) | pick(256)], // MOVW, MOVT
  () => [[0xf200, 0xf2a0][pick(2)] | low(), (pick(8) << 12) | (low() << 8) | pick(256)], // ADDW, SUBW
  () => [0xf20f, (low() << 8) | pick(64)], // ADR
  () => [[0xf340, 0xf3c0][pick(2)] | low(), (low() << 8) | (pick(4) << 6) | pick(16)],
  () => [0xf360 | low(), (low() << 8) | (pick(4) << 6) | (8 + pick(8))],
  () => [0xf300 | (pick(2) << 7) | low(), (low() << 8) | pick(31)], // SSAT, USAT
  () => [0xfb00 | low(), ([15, 1][pick(2)] << 12) | d()],
  () => [[0xfb80, 0xfba0, 0xfbc0, 0xfbe0][pick(4)] | low(), (low() << 12) | d()],
  () => [[0xfb90, 0xfbb0][pick(2)] | low(), 0xf0f0 | d()],
  () => [0xfb10 | low(), (low() << 12) | (pick(4) << 4) | d()],
  () => [0xfa80 | ([0, 1, 2, 4, 5, 6][pick(6)] << 4) | low(), 0xf000 | ([0, 1, 2, 4, 5, 6][pick(6)] << 4) | d()],
  () => [0xfaa0 | low(), 0xf080 | d()], // SEL
  () => [[0xf8d0, 0xf890, 0xf8b0, 0xf990, 0xf9b0, 0xf8c0, 0xf880, 0xf8a0][pick(8)] | base(), (low() << 12) | pick(128)],
  () => [[0xf850, 0xf810, 0xf830, 0xf840, 0xf800, 0xf820][pick(6)] | base(), (low() << 12) | [0xc00, 0xe00][pick(2)] | pick(64)],
  () => [[0xf850, 0xf840][pick(2)] | 4, (low() << 12) | [0xb00, 0xd00, 0x900, 0xf00][pick(4)] | (4 * pick(4))], // with writeback
  () => [[0xf8df, 0xf85f][pick(2)], (low() << 12) | (4 * pick(16))], // literals
  () => [[0xe9d0, 0xe9c0, 0xe950][pick(3)] | base(), (low() << 12) | (low() << 8) | pick(16)],
  () => [0xe9df, (low() << 12) | (low() << 8) | pick(16)],
  () => [[0xe890, 0xe880, 0xe910, 0xe900][pick(4)] | base(), 1 + pick(15)],
  () => [[0xe850, 0xe840][pick(2)] | 4, (low() << 12) | (low() << 8) | pick(8)], // LDREX, STREX
  () => [0xf000 | pick(2), 0xf800 | pick(8)], // BL
  () => [0xf000, 0x8000 | pick(8)], // BEQ.W
  () => [0xf3ef, 0x8000 | (low() << 8) | [0, 3, 5, 8, 9, 16, 20][pick(7)]],
  () => [0xf380 | low(), 0x8800 | [0, 16, 17][pick(3)]],
  () => [0xf3bf, [0x8f4f, 0x8f5f, 0x8f6f][pick(3)]], // DSB, DMB, ISB
  () => [[0xee30, 0xee20, 0xee80, 0xee00][pick(4)] | low(), (low() << 12) | 0xa00 | low()],
  () => [[0xed90, 0xed80][pick(2)] | base(), (low() << 12) | 0xa00 | pick(16)],
  () => [[0xee00, 0xee10][pick(2)] | low(), (low() << 12) | 0xa10],
  () => [0xeeb4, (low() << 12) | 0xa40 | low()],
  () => [0xeef1, 0xfa10],
  () => (pick(8) ? 0xbf00 : [0xbf20, 0xbf30, 0xbf40, 0xbe00, 0xde00, 0xdf01, 0xb672, 0xb662][pick(8)]), // WFE, WFI, SEV, BKPT, UDF, SVC, CPS
];

const outside = (pc) => (pc - 0x10000000) >>> 0 > 0x400000 && (pc - 0x20000000) >>> 0 > 0x82000;

/** Run the blocks, as steps or as functions; return a hash of the states. */
function blocks(asFunctions) {
  seed = 20261129;
  const hash = createHash('sha256');
  const { native } = makeM33();
  next: for (let block = 0; block < BLOCKS; block++) {
    const start = (block % 2 ? 0x10001000 : 0x20004000) + 512 * (block % 97) + 2 * pick(4);
    const code = Array.from({ length: LENGTH }, () => CLASSES[pick(CLASSES.length)]()).flat();
    const bytes = Uint8Array.from({ length: 1024 }, () => pick(256));
    let halted = false;
    const { core } = makeM33({ native, xipMiss: 1, onHalt: () => (halted = true) });
    native.core = core;
    (block % 2 ? core.flash16 : core.ram16).set([...code, HERE, BX_LR], (start & 0xffffff) >> 1);
    core.ram8.set(bytes, DATA & 0xffffff);
    core.VTOR = VECTORS;
    core.ram32[((VECTORS & 0xffffff) >> 2) + EXCEPTION] = HANDLER + 1;
    core.ram16.set([0x1c40, 0x9900, BX_LR], (HANDLER & 0xffffff) >> 1);
    native.restored();
    core.r.set(Array.from({ length: 13 }, value));
    for (const n of [4, 5, 6]) {
      const inFlash = 0x10000000 + (start & 0x1fff) + 0x2000 * (1 + pick(7)); // in the same lines of the cache as the code
      core.r[n] = (n > 4 && pick(2) ? inFlash & ~3 : DATA) + 4 * pick(64) + (pick(8) ? 0 : pick(4));
    }
    core.r[7] = pick(64);
    core.r[8] = start + 2 * pick(LENGTH) + 1;
    core.r[13] = STACK;
    core.r[14] = start + 2 * code.length + 1;
    core.r[15] = start;
    core.apsr = pick(16) << 28;
    new Float32Array(core.si.buffer, core.si.byteOffset, 16).forEach((_, i, floats) => (floats[i] = pick(1000) / 8 - 60));
    core.sliceEnd = Infinity;
    let limit = 0;
    for (let run = 0; run < 20 && !halted && !core.waiting; run++) {
      if (!core.handlerMode && pick(4) === 0) core.exceptionEntry(EXCEPTION);
      limit = Math.max(limit, core.cyc) + 1 + pick(40);
      core.limit = core.budget = limit;
      if (asFunctions) native.link([core.r[15]]);
      core.execute();
      if (outside(core.r[15])) continue next;
      hash.update(JSON.stringify([...core.r.subarray(0, 15), halted || core.r[15], core.apsr >>> 0, core.cyc, core.PM, core.xipMisses, halted, core.waiting, core.pendingSVCall, core.mrs(20)]));
    }
    hash.update(core.ram8.subarray(0x1000, 0x4000)).update(new Uint8Array(core.si.buffer, core.si.byteOffset, 64)).update(core.xipOld);
  }
  return hash.digest('hex');
}

const [steps, functions] = [blocks(false), blocks(true)];
assert.equal(functions, steps);
if (BLOCKS === RECORDED.blocks) assert.equal(steps, RECORDED.hash);

const firmware = fs.readFileSync(process.argv[3]);
const boards = [{ hot: NEVER }, { hot: 16, batch: 8 }].map((options) => new Pico2({ firmware, native: options }));
for (const board of boards) board.startTrace(new Trace([...Array(30).keys()]));
for (let ns = 0, step = 1; ns < 160e6; ns += step, step = 1 + ((step * 7919) % 300_007)) {
  const found = boards.map((board) => {
    board.runUntil(ns);
    const { core } = board;
    return [...core.r, core.apsr, core.cycles, core.xipMisses, board.clock.nanos, board.events.length];
  });
  assert.deepEqual(found[1], found[0], `at ${ns} ns`);
}
const edges = boards.map(({ trace }) => Buffer.from(trace.take()));
assert.ok(edges[0].equals(edges[1]));
assert.ok(Buffer.from(boards[0].core.ram8).equals(boards[1].core.ram8));
const [few, more] = boards.map(({ pieces }) => pieces);
assert.ok(more > few + 400);
console.log(`random blocks: steps and functions agree; a board's as well, with ${more - few} functions`);
