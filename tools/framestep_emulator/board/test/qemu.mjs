// Random instructions of a processor, one at a time from a random state, have the results that they have in QEMU: registers, flags, floats
// and memory.
//
// usage: node qemu.mjs m0|m33                compares with the answers in qemu_m0.txt, qemu_m33.txt
//        node qemu.mjs m0|m33 --record       renews them first
//        node qemu.mjs m0|m33 ROUNDS [SEED]  asks QEMU about other cases
//
// The last two need qemu-arm and the binutils of arm-none-eabi. A line of the answers: a case's instructions, and what they change.
//
// QEMU's processor is an A-profile one with the same encodings. Any NaN counts as equal to any other. No branches,
// exclusives, exceptions or coprocessors: the firmware shows these. An M0+ has the groups whose names end with 16.

import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { STATE } from '../lib/rp2350/emit.mjs';
import { makeCore, makeM33 } from './chip.mjs';

const [KIND, ASKED] = process.argv.slice(2);
const M0 = KIND === 'm0';
const RECORD = new URL(`qemu_${KIND}.txt`, import.meta.url);
const RENEW = ASKED === '--record';
const ROUNDS = RENEW ? 50 : Number(ASKED ?? 50);
const RESULT = 94; // words of a case: APSR, r0 to r12, s0 to s15, 64 of memory
const WORDS = 64; // of memory, r12 points into their middle
const CODE = 0x20000200; // where a case runs here
const DATA = 0x20001000; // its memory, here and in QEMU
const NZCVQ_GE = 0xf80f0000;
const AT_ONCE = 1000; // cycles; with one at a time each instruction ends at its limit

let seed = Number(process.argv[4] ?? 20261127) >>> 0;

function random() {
  seed ^= seed << 13;
  seed >>>= 0;
  seed ^= seed >>> 17;
  seed ^= seed << 5;
  seed >>>= 0;
  return seed;
}

const pick = (list) => list[random() % list.length];
const reg = () => random() % 12; // r0 to r11

/** Return [group, halfwords] of instructions, some from each group a round. */
function drawn(rounds) {
  const out = [];
  const add = (group, ...h) => out.push([group, h.map((x) => x & 0xffff)]);
  for (let i = 0; i < rounds; i++) {
    add('shift16', (random() & 0x17ff) % 0x1800);
    add('addsub16', 0x1800 | (random() & 0x7ff));
    add('imm16', 0x2000 | (random() & 0x1fff));
    add('alu16', 0x4000 | (random() & 0x3ff));
    { const d = random() % 12; add('hi16', pick([0x4400, 0x4500, 0x4600]) | (d & 7) | ((d & 8) << 4) | ((random() & 7) << 3)); }
    add('ext16', 0xb200 | (random() & 0xff));
    add('rev16', pick([0xba00, 0xba40, 0xbac0]) | (random() & 0x3f));
    const offset = 4 * (random() & 31);
    const memory = 0x4667; // MOV r7, r12
    add('load16', memory, pick([0x6000, 0x6800, 0x7000, 0x7800, 0x8000, 0x8800]) | ((random() & 31) << 6) | (7 << 3) | (random() % 7));
    add('index16', memory, 0x2600 | offset, 0x5000 | ((random() & 7) << 9) | (6 << 6) | (7 << 3) | (random() % 6)); // after MOV r6
    add('multiple16', memory, pick([0xc700, 0xcf00]) | (1 + (random() % 127)));
    // IT with three instructions
    add('it', 0xbf00 | (pick([0,1,2,3,4,5,6,7,8,9,10,11,12,13]) << 4) | pick([0x2,0x6,0xa,0xe]), pick([0x1800 | (random() & 0x7ff), 0x2000 | (random() & 0x7ff), 0x4000 | (random() & 0x3ff)]), pick([0x1800 | (random() & 0x7ff), 0x2800 | (random() & 0x7ff), 0x4000 | (random() & 0x3ff)]), 0x3000 | (random() & 0x7ff));
    for (const op of [0, 1, 2, 3, 4, 8, 10, 11, 13, 14]) {
      const S = random() & 1, d = reg(), n = reg(), m = reg();
      add('dpshift', 0xea00 | (op << 5) | (S << 4) | n, ((random() & 7) << 12) | (d << 8) | ((random() & 15) << 4) | m);
      add('dpimm', 0xf000 | ((random() & 1) << 10) | (op << 5) | (S << 4) | n, ((random() & 7) << 12) | (d << 8) | (random() & 0xff));
    }
    for (const op of [2, 3]) add('movmvn', 0xea00 | (op << 5) | ((random() & 1) << 4) | 15, ((random() & 7) << 12) | (reg() << 8) | ((random() & 15) << 4) | reg());
    for (const op of [0, 4, 8, 13]) add('tst', 0xea00 | (op << 5) | 16 | reg(), ((random() & 7) << 12) | (15 << 8) | ((random() & 15) << 4) | reg());
    add('pkh', 0xeac0 | reg(), ((random() & 7) << 12) | (reg() << 8) | ((random() & 0xe) << 4) | reg());
    add('addw', pick([0xf200, 0xf2a0]) | ((random() & 1) << 10) | reg(), ((random() & 7) << 12) | (reg() << 8) | (random() & 0xff));
    add('movw', pick([0xf240, 0xf2c0]) | ((random() & 1) << 10) | (random() & 15), ((random() & 7) << 12) | (reg() << 8) | (random() & 0xff));
    { const lsb = random() % 32, w = random() % (32 - lsb), d = reg();
      add('bfx', pick([0xf340, 0xf3c0]) | reg(), ((lsb >> 2) << 12) | (d << 8) | ((lsb & 3) << 6) | w);
      add('bfi', 0xf360 | pick([reg(), 15]), ((lsb >> 2) << 12) | (d << 8) | ((lsb & 3) << 6) | (lsb + w)); }
    { const sh = random() % 31 + 1; add('sat', pick([0xf300, 0xf320, 0xf380, 0xf3a0]) | reg(), ((sh >> 2) << 12) | (reg() << 8) | ((sh & 3) << 6) | (random() & 31)); }
    add('sathalves', pick([0xf320, 0xf3a0]) | reg(), (reg() << 8) | (random() & 15));
    add('shreg', 0xfa00 | ((random() & 7) << 4) | reg(), 0xf000 | (reg() << 8) | reg());
    add('extadd', 0xfa00 | ((random() % 6) << 4) | pick([15, reg()]), 0xf080 | (reg() << 8) | ((random() & 3) << 4) | reg());
    add('parallel', 0xfa80 | (pick([0, 1, 2, 4, 5, 6]) << 4) | reg(), 0xf000 | (reg() << 8) | (pick([0, 1, 2, 4, 5, 6]) << 4) | reg());
    add('qadd', 0xfa80 | reg(), 0xf080 | (reg() << 8) | ((random() & 3) << 4) | reg());
    { const m = reg(); add('revw', 0xfa90 | m, 0xf080 | (reg() << 8) | ((random() & 3) << 4) | m); add('clz', 0xfab0 | m, 0xf080 | (reg() << 8) | m); }
    add('sel', 0xfaa0 | reg(), 0xf080 | (reg() << 8) | reg());
    add('mul', 0xfb00 | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | reg());
    add('mls', 0xfb00 | reg(), (reg() << 12) | (reg() << 8) | 0x10 | reg());
    add('smlaxy', 0xfb10 | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | ((random() & 3) << 4) | reg());
    add('smlad', pick([0xfb20, 0xfb40]) | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | ((random() & 1) << 4) | reg());
    add('smlaw', 0xfb30 | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | ((random() & 1) << 4) | reg());
    add('smmla', 0xfb50 | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | ((random() & 1) << 4) | reg());
    add('smmls', 0xfb60 | reg(), (reg() << 12) | (reg() << 8) | ((random() & 1) << 4) | reg());
    add('usad', 0xfb70 | reg(), (pick([15, reg()]) << 12) | (reg() << 8) | reg());
    { const l = reg(), h = (l + 1 + random() % 10) % 12; add('long', pick([0xfb80, 0xfba0, 0xfbc0, 0xfbe0]) | reg(), (l << 12) | (h << 8) | reg()); add('umaal', 0xfbe0 | reg(), (l << 12) | (h << 8) | 0x60 | reg()); }
    { const l = reg(), h = (l + 1 + random() % 10) % 12;
      add('smlalxy', 0xfbc0 | reg(), (l << 12) | (h << 8) | 0x80 | ((random() & 3) << 4) | reg());
      add('smlald', pick([0xfbc0, 0xfbd0]) | reg(), (l << 12) | (h << 8) | 0xc0 | ((random() & 1) << 4) | reg()); }
    add('div', pick([0xfb90, 0xfbb0]) | reg(), 0xf0f0 | (reg() << 8) | reg());
    // floating point: s0 to s15
    const F = () => { const x = random() & 15; return [x >> 1, x & 1]; };
    const [dv, dD] = F(), [nv, nN] = F(), [mv, mM] = F();
    const three = (cls, h, g) => add(cls, h | (dD << 6) | nv, g | (dv << 12) | 0xa00 | (nN << 7) | (mM << 5) | mv);
    const two = (cls, h, g) => add(cls, h | (dD << 6), g | (dv << 12) | 0xa00 | (mM << 5) | mv);
    three('vadd', 0xee30, 0); three('vsub', 0xee30, 0x40); three('vmul', 0xee20, 0); three('vnmul', 0xee20, 0x40); three('vdiv', 0xee80, 0);
    three('vmla', 0xee00, 0); three('vmls', 0xee00, 0x40); three('vnmls', 0xee10, 0); three('vnmla', 0xee10, 0x40);
    three('vfma', 0xeea0, 0); three('vfms', 0xeea0, 0x40); three('vfnms', 0xee90, 0); three('vfnma', 0xee90, 0x40);
    two('vabs', 0xeeb0, 0xc0); two('vneg', 0xeeb1, 0x40); two('vsqrt', 0xeeb1, 0xc0); two('vmov', 0xeeb0, 0x40);
    two('vcvt', 0xeeb8, pick([0x40, 0xc0])); two('vcvti', pick([0xeebc, 0xeebd]), pick([0x40, 0xc0]));
    two('vrint', pick([0xeeb6, 0xeeb7]), 0x40); two('vrintz', 0xeeb6, 0xc0);
    add('vcmp', 0xeeb4 | (dD << 6), (dv << 12) | 0xa40 | (mM << 5) | mv, 0xeef1, 0xfa10);
    add('vcmp0', 0xeeb5 | (dD << 6), (dv << 12) | 0xa40, 0xeef1, 0xfa10);
    add('vmovi', 0xeeb0 | (dD << 6) | (random() & 15), (dv << 12) | 0xa00 | (random() & 15));
    add('vmovr', pick([0xee00, 0xee10]) | nv, (reg() << 12) | 0xa10 | (nN << 7));
    three('vsel', 0xfe00 | ((random() & 3) << 4), 0); three('vmaxnm', 0xfe80, pick([0, 0x40]));
    two('vrinta', 0xfeb8 | (random() & 3), 0x40); two('vcvta', 0xfebc | (random() & 3), pick([0x40, 0xc0]));
    // memory: r11 points into the data block
    const off = random() & 0x7c;
    add('ldr', pick([0xf8d0, 0xf890, 0xf8b0, 0xf990, 0xf9b0, 0xf8c0, 0xf880, 0xf8a0]) | 12, (reg() << 12) | off);
    add('ldrx', pick([0xf850, 0xf810, 0xf830, 0xf910, 0xf930, 0xf840, 0xf800, 0xf820]) | 12, (reg() << 12) | pick([0xb00, 0x900, 0xf00, 0xd00, 0xc00]) | (random() & 0x3f));
    { const t = reg(); add('ldrd', pick([0xe9d0, 0xe9c0, 0xe9f0, 0xe8f0, 0xe960 | 0x10]) | 12, (t << 12) | (((t + 1) % 12) << 8) | (random() & 15)); }
    add('ldm', pick([0xe890, 0xe8b0, 0xe910, 0xe930, 0xe880, 0xe8a0, 0xe900, 0xe920]) | 12, (random() & 0x0fff) | 3);
    add('vldr', pick([0xed90, 0xed80, 0xed10]) | (dD << 6) | 12, (dv << 12) | 0xa00 | (random() & 15));
    add('vldm', pick([0xec90, 0xecb0, 0xed30, 0xec80, 0xeca0, 0xed20]) | 12, (random() & 3) << 12 | 0xa00 | (1 + (random() & 7)));
  }
  return out;
}

const SPECIAL = [0, 1, -1, 0x7fffffff, 0x80000000, 0xffff, 0x8000, 31, 32, 33, 255];
const FLOATS = [
  0, 0x80000000, 0x3f800000, 0xbf800000, 0x7f800000, 0xff800000, 0x40490fdb, 0x4b800000, 0x4f000000, 0xcf000000, 0x3f000000,
  0x3fc00000, 0xbfc00000, 0x40200000, 0x3effffff, 0x7f7fffff,
];
const word = () => (random() % 3 === 0 ? pick(SPECIAL) : random()) >>> 0;
/** A float, mostly of modest size, so that results are seldom denormal. */
const float = () =>
  (random() % 3 === 0 ? pick(FLOATS) : (random() & 0x807fffff) | ((100 + (random() % 56)) << 23)) >>> 0;
const pattern = (i) => Math.imul(i + 1, 0x9e3779b1) >>> 0;

/** Return cases: instructions and the state that they begin with. */
function cases(rounds) {
  return drawn(rounds).filter(([group]) => !M0 || group.endsWith('16')).map(([group, code]) => {
    let flags = (random() & 0xf0000000) >>> 0;
    if (flags >>> 30 === 3) flags = (flags & 0x3fffffff) >>> 0; // never N and Z at once
    return {
      group,
      code,
      flags,
      ge: random() & 15,
      r: Array.from({ length: 12 }, word),
      s: Array.from({ length: 16 }, float),
    };
  });
}

/** Return a program that runs each case and writes its results to standard output. */
function program(all) {
  const numbered = (line) => all.map(line).join('\n');
  return `
.syntax unified
.arch armv8-a
.fpu neon-fp-armv8
.thumb
.text
.global _start
.thumb_func
_start:
  ldr r4, =table
  ldr r5, =count
  ldr r5, [r5]
1: ldr r0, [r4], #4
  push {r4, r5}
  bl run
  pop {r4, r5}
  subs r5, #1
  bne 1b
  mov r0, #1
  ldr r1, =results
  ldr r2, =resend
  subs r2, r1
  mov r7, #4
3: push {r1,r2}
  svc 0
  pop {r1,r2}
  cmp r0, #0
  ble 4f
  add r1, r0
  subs r2, r0
  mov r0, #1
  bne 3b
4: mov r0, #0
  mov r7, #1
  svc 0
.ltorg
.thumb_func
run:
  push {r4-r11, lr}
  ldr r1, =where
  str sp, [r1]
  add r2, r0, #56
  vldmia r2, {s0-s15}
  ldr r2, =data
  ldr r3, =pattern
  mov r1, #${WORDS}
5: ldr r4, [r3], #4
  str r4, [r2], #4
  subs r1, #1
  bne 5b
  ldr lr, [r0]
  ldr r1, [r0, #4]
  msr APSR_nzcvqg, r1
  add r0, #8
  ldr r12, =data+128
  ldmia r0, {r0-r11}
  bx lr
.ltorg
.thumb_func
back:
  ldr sp, =saveend
  push {r0-r12}
  mrs r1, APSR
  push {r1}
  ldr r2, =outp
  ldr r3, [r2]
  pop {r4}
  str r4, [r3], #4
  mov r5, #13
6: pop {r4}
  str r4, [r3], #4
  subs r5, #1
  bne 6b
  vstmia r3!, {s0-s15}
  ldr r4, =data
  mov r5, #${WORDS}
7: ldr r6, [r4], #4
  str r6, [r3], #4
  subs r5, #1
  bne 7b
  str r3, [r2]
  ldr r1, =where
  ldr sp, [r1]
  pop {r4-r11, pc}
.ltorg
${numbered((c, i) => `.balign 4\nc${i}: .2byte ${c.code.join(', ')}\n b.w back`)}
.data
.balign 4
where: .word 0
outp: .word results
count: .word ${all.length}
table:
${numbered((c, i) => `.word t${i}`)}
${numbered((c, i) => `t${i}: .word c${i}+1, ${(c.flags | (c.ge << 16)) >>> 0}, ${c.r.join(', ')}, ${c.s.join(', ')}`)}
pattern:
${Array.from({ length: WORDS }, (_, i) => `.word ${pattern(i)}`).join('\n')}
.space 64
saveend: .word 0
.section .case, "aw"
data: .space ${4 * WORDS}
.bss
.balign 4
results: .space ${all.length * RESULT * 4}
resend:
`;
}

/** Return QEMU's answers. */
function inQemu(all) {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'm33-'));
  const at = (name) => path.join(folder, name);
  try {
    fs.writeFileSync(at('cases.s'), program(all));
    execFileSync('arm-none-eabi-as', [at('cases.s'), '-o', at('cases.o')]);
    execFileSync('arm-none-eabi-ld', ['-Ttext=0x10000', `--section-start=.case=0x${DATA.toString(16)}`, '--no-warn-rwx-segments', at('cases.o'), '-o', at('cases')]);
    const found = execFileSync('qemu-arm', ['-cpu', 'max', at('cases')], { maxBuffer: 1 << 30 });
    const words = new Uint32Array(found.buffer, found.byteOffset, found.length / 4);
    return all.map((c, i) => answer(c, words.subarray(i * RESULT, (i + 1) * RESULT)));
  } finally {
    fs.rmSync(folder, { recursive: true });
  }
}

let reason = '';

/** Put a case into the memory of a core, and its state. */
function prepare(core, c) {
  const code = (CODE & 0xffff) / 2;
  const data = (DATA & 0xffff) / 4;
  reason = '';
  core.halted = false;
  c.code.forEach((half, i) => (core.ram16[code + i] = half));
  core.ram16[code + c.code.length] = 0xbe00; // BKPT
  core.r.set(c.r);
  core.r[12] = DATA + 128;
  core.r[13] = 0x20020000;
  core.r[14] = 0;
  core.r[15] = CODE;
  for (let i = 0; i < WORDS; i++) core.ram32[data + i] = pattern(i);
}

/** Return the words of a case that has run, or what went wrong. */
function result(core, flags, floats) {
  const data = (DATA & 0xffff) / 4;
  if (!reason.startsWith('breakpoint')) return reason || 'it did not end';
  return Uint32Array.from([flags, ...core.r.subarray(0, 13), ...floats, ...core.ram32.subarray(data, data + WORDS)]);
}

/** Run a case on an M33, in pieces of some cycles, as steps or as a function. */
function onM33({ core, native }, c, cycles, asFunction) {
  prepare(core, c);
  if (asFunction) {
    native.core = core;
    native.stale(CODE);
    native.link([CODE]);
  }
  core.si.set(c.s);
  core.st[STATE.fpscr] = 0;
  core.apsr = c.flags;
  core.st[STATE.ge] = c.ge;
  core.st[STATE.sticky] = 0;
  for (let left = 100; !core.halted && left; left--) {
    core.st[0] = 0;
    core.st[1] = cycles;
    core.execute();
  }
  return result(core, core.apsr, core.si.subarray(0, 16));
}

/** Run a case on an M0+, by the interpreter or as a piece. */
function onM0({ core, native }, c, asPiece) {
  prepare(core, c);
  if (asPiece) native.link([CODE]);
  core.APSR = c.flags;
  core.cyc = 0;
  core.sliceEnd = Infinity;
  core.limit = core.budget = AT_ONCE;
  core.execute();
  return result(core, core.APSR | (c.ge << 16), c.s);
}

const isNan = (x) => (x & 0x7f800000) === 0x7f800000 && (x & 0x7fffff) !== 0;
const name = (i) => (i === 0 ? 'apsr' : i < 14 ? `r${i - 1}` : i < 30 ? `s${i - 14}` : `m${i - 30}`);

/** Return a case's line, from the words of its result. */
function answer(c, words) {
  const begun = [c.flags | (c.ge << 16), ...c.r, DATA + 128, ...c.s, ...Array.from({ length: WORDS }, (_, i) => pattern(i))];
  const line = [c.code.map((half) => half.toString(16).padStart(4, '0')).join('')];
  begun.forEach((before, i) => {
    const after = i ? words[i] : words[i] & NZCVQ_GE;
    if (after >>> 0 === before >>> 0) return;
    line.push(`${name(i)}=${i >= 14 && i < 30 && isNan(after) ? 'nan' : (after >>> 0).toString(16)}`);
  });
  return line.join(' ');
}

const all = cases(ROUNDS);
const wanted = ASKED ? inQemu(all) : fs.readFileSync(RECORD, 'latin1').trimEnd().split('\n');
if (RENEW) fs.writeFileSync(RECORD, `${wanted.join('\n')}\n`);
const onHalt = (text) => (reason = text);
let ways;
if (M0) {
  const made = makeCore({ onHalt });
  ways = [false, true].map((asPiece) => (c) => onM0(made, c, asPiece));
} else {
  const made = makeM33({ onHalt });
  ways = [[AT_ONCE, false], [AT_ONCE, true], [1, false]].map((way) => (c) => onM33(made, c, ...way));
}
const groups = new Set(all.map((c) => c.group));
let wrong = wanted.length === all.length ? 0 : 1;
for (const here of ways) all.forEach((c, i) => {
  let mine;
  try {
    const found = here(c);
    mine = typeof found === 'string' ? found : answer(c, found);
  } catch (error) {
    [mine] = error.message.split('\n');
  }
  if (mine === wanted[i]) return;
  wrong++;
  if (wrong <= 20) console.log(`case ${i}, ${c.group}, flags ${(c.flags >>> 28).toString(16)}: ${mine}\n  in QEMU: ${wanted[i]}`);
});
console.log(`${all.length} cases of ${groups.size} groups, ${wrong} differ`);
process.exit(wrong || !all.length ? 1 : 0);
