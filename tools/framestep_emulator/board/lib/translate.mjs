// Translates Thumb code to a WebAssembly function. The function takes the number of the leader at which it begins, and
// returns the address at which it ends. A leader is an address to which something branches: the code from one to the next
// is a block. Before a block the cycles that it takes without cache misses and peripherals must fit into the limit; after
// a miss or a peripheral they are compared again, so that no instruction runs that the interpreter would not run.
//
// What is rare or complicated is left to the interpreter: the function ends before it.

import { AT, FLASH_SIZE, LEFT, RAM_BASE, RAM_SIZE, XIP_LINES } from './layout.mjs';
import { Code, moduleMaker } from './wasm.mjs';

const MAX_INSTRUCTIONS = 96;
const MAX_BLOCK = 24; // instructions; the longer a block, the more is left to the interpreter near the limit

// [parameters, results]: translated code; a load (offset from RAM_BASE, cycles and lines so far: `sofar`); a store
// (the same, value); the miss of a line
export const TYPES = [[1, 1], [2, 1], [3, 0], [1, 0]];
export const CODE_TYPE = 0;
export const IMPORTS = [
  ['load32', 1],
  ['load16', 1],
  ['load8', 1],
  ['store32', 2],
  ['store16', 2],
  ['store8', 2],
  ['miss', 3],
];
const MISS = 6;
const SHIFT = { 32: 2, 16: 1, 8: 0 };
const LOADS = { 32: [0, 'load'], 16: [1, 'load16'], 8: [2, 'load8'] };
const STORES = { 32: [3, 'store'], 16: [4, 'store16'], 8: [5, 'store8'] };

// Registers and flags stay in memory: their addresses. Locals hold them in code too long for the processor's cache.
const R = (n) => AT.registers + 4 * n;

// Locals
const NEXT = 0; // the parameter
const T = 1;
const A = 2;
const B = 3;
const RES = 4;
const X = 5;
const LOCALS = 5; // apart from the parameter

const FLAGS = { nz: 1, c: 2, v: 4 };
const ALL = 7;

const popcount = (bits) => {
  let count = 0;
  for (; bits; bits &= bits - 1) count++;
  return count;
};

// ------------------------------------------------------------------ decoding

/**
 * What the translation has to know of an instruction before it emits code, or null if the interpreter has to do it:
 * {kind, cost, target, reads, writes}: kinds are "plain", "branch" (conditional), "jump" (never comes back here),
 * "call"; reads and writes are masks of FLAGS; exits: it may end the function in its middle; size in bytes.
 */
function decode(op, op2, pc) {
  const plain = (writes = 0, more = {}) => ({ kind: 'plain', cost: 1, reads: 0, writes, exits: false, size: 2, ...more });
  const memory = { cost: 2, exits: true };
  const shifted = (op >> 6) & 31;
  switch (op >>> 11) {
    case 0:
      return plain(shifted ? 3 : 1);
    case 1:
    case 2:
      return plain(3);
    case 3:
    case 5:
    case 6:
    case 7:
      return plain(ALL);
    case 4:
      return plain(1);
    case 8: {
      if (op & 0x400) {
        const source = (op >> 3) & 15;
        const d = ((op >> 4) & 8) | (op & 7);
        switch ((op >> 8) & 3) {
          case 0:
          case 2:
            return d === 15 ? plain(0, { kind: 'jump', cost: 2 }) : plain();
          case 1:
            return d === 15 ? null : plain(ALL);
          default:
            return source === 15 ? null : plain(0, { kind: op & 0x80 ? 'call' : 'jump', cost: 2, exits: true });
        }
      }
      const writes = [1, 1, 3, 3, 3, 7, 7, 3, 1, 7, 7, 7, 1, 1, 1, 1][(op >> 6) & 15];
      const reads = [0, 0, 2, 2, 2, 2, 2, 2, 0, 0, 0, 0, 0, 0, 0, 0][(op >> 6) & 15];
      return plain(writes, { reads });
    }
    case 9:
    case 10:
    case 11:
    case 12:
    case 13:
    case 14:
    case 15:
    case 16:
    case 17:
    case 18:
    case 19:
      return plain(0, memory);
    case 20:
    case 21:
      return plain();
    case 22:
    case 23:
      switch ((op >> 8) & 15) {
        case 0:
        case 2:
          return plain();
        case 4:
        case 5:
          return plain(0, { cost: 1 + popcount(op & 0x1ff), exits: true });
        case 10:
          return ((op >> 6) & 3) === 2 ? null : plain();
        case 12:
          return op & 0xff ? plain(0, { cost: 1 + popcount(op & 0xff), exits: true }) : null;
        case 13:
          return plain(0, { kind: 'jump', cost: 4 + popcount(op & 0xff), exits: true });
        case 15:
          return [0x20, 0x30, 0x40].includes(op & 0xff) ? null : plain();
      }
      return null;
    case 24:
    case 25:
      return op & 0xff ? plain(0, { cost: 1 + popcount(op & 0xff), exits: true }) : null;
    case 26:
    case 27: {
      const condition = (op >> 8) & 15;
      if (condition >= 14) return null;
      const reads = [1, 1, 2, 2, 1, 1, 4, 4, 3, 3, 5, 5, 5, 5][condition];
      return plain(0, { kind: 'branch', cost: 1, reads, target: (pc + 4 + ((op << 24) >> 23)) | 0, exits: true });
    }
    case 28:
      return plain(0, { kind: 'jump', cost: 2, target: (pc + 4 + ((op << 21) >> 20)) | 0 });
    case 30: {
      if ((op2 & 0xd000) === 0xd000) {
        const s = (op >> 10) & 1;
        const i1 = 1 ^ s ^ ((op2 >> 13) & 1);
        const i2 = 1 ^ s ^ ((op2 >> 11) & 1);
        const offset = (s ? -0x1000000 : 0) | (i1 << 23) | (i2 << 22) | ((op & 0x3ff) << 12) | ((op2 & 0x7ff) << 1);
        return plain(0, { kind: 'call', cost: 3, size: 4, target: (pc + 4 + offset) | 0 });
      }
      return op === 0xf3bf ? plain(0, { cost: 3, size: 4 }) : null; // DMB, DSB, ISB
    }
  }
  return null;
}

// In the place of instructions for which the function ends: "stop", one that only the interpreter does; "cold", some to
// which nothing has come so far
const LEFT_OUT = { cost: 0, reads: 0, writes: 0, exits: true };

/** The instructions from `start` on, up to a jump that nothing before it passes over. */
function collect(code, seen, base, start) {
  const instructions = [];
  let furthest = start;
  let pc = start;
  while (instructions.length < MAX_INSTRUCTIONS) {
    const index = (pc - base) >> 1;
    if (index + 1 >= code.length) break;
    if (!seen[index] && pc !== start) {
      // nothing has come here so far
      const before = instructions[instructions.length - 1];
      if (!['jump', 'cold'].includes(before.kind)) instructions.push({ ...LEFT_OUT, kind: 'cold', pc, size: 2 });
      pc += 2;
      if (furthest < pc) break;
      continue;
    }
    const op = code[index];
    const found = decode(op, code[index + 1], pc);
    if (!found) {
      if (furthest <= pc) break;
      // it ends its block, but something passes over it
      const size = op >>> 11 >= 29 ? 4 : 2;
      instructions.push({ ...LEFT_OUT, kind: 'stop', pc, size });
      pc += size;
      continue;
    }
    instructions.push({ ...found, op, pc });
    pc += found.size;
    if (found.kind === 'branch' || (found.kind === 'jump' && found.target !== undefined)) {
      const distance = found.target - start;
      if (distance > furthest - start && distance < 4 * MAX_INSTRUCTIONS) furthest = found.target;
    }
    if (found.kind === 'jump' && furthest < pc) break;
  }
  return { instructions, past: pc };
}

function findLeaders(instructions, start) {
  const leaders = new Set([start]);
  const known = instructions.filter(({ kind }) => kind !== 'cold');
  const addresses = new Set(known.map(({ pc }) => pc));
  for (const { kind, target, pc, size } of known) {
    if (target !== undefined && kind !== 'call' && addresses.has(target)) leaders.add(target);
    if (kind !== 'plain' && kind !== 'branch' && addresses.has(pc + size)) leaders.add(pc + size);
  }
  let length = 0;
  let afterCold = false;
  for (const { pc, kind } of instructions) {
    if (kind !== 'cold' && (afterCold || length >= MAX_BLOCK)) leaders.add(pc);
    if (leaders.has(pc)) length = 0;
    length++;
    afterCold = kind === 'cold';
  }
  return [...leaders].sort((a, b) => a - b);
}

// ------------------------------------------------------------------ emitting

class Translation {
  constructor(code, seen, base, start, firstEnd) {
    this.firstEnd = firstEnd;
    this.ends = []; // [cycles, lines, last line, LEFT, address]
    this.halfwords = code;
    this.base = base;
    this.inRam = base === RAM_BASE;
    Object.assign(this, collect(code, seen, base, start));
    this.leaders = findLeaders(this.instructions, start);
    this.code = new Code();
  }

  /** The whole function; null if the interpreter has to do its first instruction. */
  function() {
    const { instructions, leaders, code, base } = this;
    if (!instructions.length || instructions[0].kind === 'stop') return null;
    const blocks = leaders.map((address, i) =>
      instructions.filter(({ pc }) => pc >= address && (i + 1 === leaders.length || pc < leaders[i + 1]))
    );
    code.loop(); // 1: branches back
    leaders.forEach(() => code.block());
    code.get(NEXT).brTable(leaders.map((_, i) => this.blockDepth(i)));
    blocks.forEach((block, i) => {
      code.end();
      this.current = i;
      this.block(block);
    });
    code.end();
    code.i32(0); // nothing comes here
    const first = (leaders[0] - base) >> 1;
    return {
      code,
      leaders,
      ends: this.ends,
      first,
      source: this.halfwords.slice(first, (this.past - base) >> 1),
    };
  }

  /** The depth of the block whose end is leader i. */
  blockDepth(i) {
    return 1 + this.leaders.length - i;
  }

  block(block) {
    const { code, leaders, current } = this;
    const start = leaders[current];
    const costs = block.map(({ cost }) => cost);
    this.before = costs.slice(0, -1).reduce((a, b) => a + b, 0); // the last one begins after so many cycles
    this.spent = 0;
    this.lines = 0; // fetched so far
    this.line = this.storedLine = -1; // unknown

    this.overLimit().if();
    this.end(start, LEFT.bail);
    code.end();
    if (this.inRam) this.compare(block);
    else {
      this.line = start >>> 3;
      this.storedLine = this.line;
      code.word(AT.line).i32(this.line).op('ne').if();
      code.i32(0).i32(this.line).memory('store', AT.line);
      code.i32(0).word(AT.xipAccesses).i32(1).op('add').memory('store', AT.xipAccesses);
      this.fetchLine(start);
      code.end();
    }

    const live = this.liveFlags(block);
    let open = true;
    block.forEach((instruction, i) => {
      const { pc, kind } = instruction;
      if (!this.inRam && i && pc >>> 3 !== this.line && kind !== 'cold') {
        this.line = pc >>> 3;
        this.lines++;
        this.fetchLine(pc);
      }
      this.need = live[i];
      this.last = i === block.length - 1;
      if (kind === 'stop') this.end(pc, LEFT.bail);
      else if (kind === 'cold') this.end(pc, LEFT.jump);
      else this.instruction(instruction);
      open = kind === 'plain' || kind === 'branch';
    });
    if (!open) return;
    const after = block[block.length - 1].pc + block[block.length - 1].size;
    if (current + 1 < leaders.length) this.settle();
    else this.end(after, LEFT.jump);
  }

  /** Which flags each instruction has to set: those that something reads before they are set again. */
  liveFlags(block) {
    const result = [];
    let live = ALL;
    for (let i = block.length - 1; i >= 0; i--) {
      const { reads, writes, exits, pc } = block[i];
      result[i] = live & writes;
      live = (live & ~writes) | reads;
      if (exits || !(this.inRam || pc & 7)) live = ALL;
    }
    return result;
  }

  /** Whether the last instruction of the block would begin at the limit or later. */
  overLimit() {
    return this.code.word(AT.cycles).i32(this.before).op('add').word(AT.limit).op('geS');
  }

  /** Fetch the flash line of an address. */
  fetchLine(pc) {
    const { code } = this;
    const line = (pc >>> 3) & (XIP_LINES - 1);
    this.touchIf(line);
    code.i32(line).call(MISS);
    this.overLimit().if();
    this.end(pc, LEFT.force);
    code.end().end();
  }

  /** Read a line of the flash; begins an `if` for the case that it is not in the cache. */
  touchIf(line) {
    const { code } = this;
    code.i32(0).memory('load8', AT.xipPresent + line).tee(A).if();
    code.i32(0).get(A).memory('store8', AT.xipOld + (line & 1023));
    code.op('else');
  }

  /** Leave if the instructions of the block in RAM are no longer those that were translated. */
  compare(block) {
    const { code, halfwords, base } = this;
    const start = block[0].pc;
    const last = block[block.length - 1];
    let at = (start - base) >> 1;
    const end = (last.pc + last.size - base) >> 1;
    const word = (i) => BigInt(halfwords[i] | (halfwords[i + 1] << 16)) & 0xffffffffn;
    code.block();
    const here = code.depth;
    code.block();
    const differs = code.depth;
    for (; at + 4 <= end; at += 4) {
      code.i32(0).memory('i64Load', AT.ram + 2 * at).i64(word(at) | (word(at + 2) << 32n)).op('i64Ne').brIf(differs);
    }
    if (at + 2 <= end) {
      code.i32(0).memory('load', AT.ram + 2 * at).i32(Number(word(at))).op('ne').brIf(differs);
      at += 2;
    }
    if (at < end) code.i32(0).memory('load16', AT.ram + 2 * at).i32(halfwords[at]).op('ne').brIf(differs);
    code.br(here);
    code.end();
    this.end(start, LEFT.stale);
    code.end();
  }

  /** Account for the block so far. */
  settle() {
    const { code, spent, lines } = this;
    if (spent || lines) {
      code.i32(0).i32(0).memory('i64Load', AT.cycles);
      code.i64(BigInt(spent) | (BigInt(lines) << 32n)).op('i64Add').memory('i64Store', AT.cycles);
    }
    if (!this.inRam && this.line !== this.storedLine) code.i32(0).i32(this.line).memory('store', AT.line);
  }

  /** End the function at an address, which may be on the stack (null). */
  end(pc, left) {
    const { code, ends } = this;
    if (pc === null) code.put(AT.pc, X);
    const found = [this.spent, this.lines, this.inRam ? -1 : this.line, left, pc ?? 0];
    let number = ends.findIndex((each) => each.every((value, i) => value === found[i]));
    if (number < 0) number = ends.push(found) - 1;
    code.i32(this.firstEnd + number).op('return');
  }

  /** Branch to a constant address, in this function if it can. */
  branch(target) {
    const { code } = this;
    const index = this.leaders.indexOf(target);
    if (index < 0) {
      this.end(target, LEFT.jump);
      return;
    }
    this.settle();
    if (index > this.current) code.br(this.blockDepth(index));
    else code.i32(index).set(NEXT).br(1);
  }

  write(n) {
    return this.code.put(R(n), X);
  }

  // ---------------------------------------------------------------- instructions

  instruction(instruction) {
    const { code } = this;
    const { op, pc, cost, kind, target } = instruction;
    const low = op & 7;
    const middle = (op >> 3) & 7;
    const high = (op >> 8) & 7;
    const byte = op & 0xff;
    this.pc = pc;
    this.next = (pc + instruction.size) | 0;
    switch (op >>> 11) {
      case 0:
      case 1:
      case 2:
        this.shift(op >>> 11, low, middle, (op >> 6) & 31);
        break;
      case 3:
        code.word(R(middle)).set(A);
        if (op & 0x400) code.i32((op >> 6) & 7).set(B);
        else code.word(R((op >> 6) & 7)).set(B);
        if (op & 0x200) this.subtract();
        else this.add();
        code.get(RES);
        this.write(low);
        break;
      case 4:
        code.i32(byte);
        this.write(high);
        if (this.need & FLAGS.nz) code.i32(byte).put(AT.nz, X);
        break;
      case 5:
        code.word(R(high)).set(A).i32(byte).set(B);
        this.subtract();
        break;
      case 6:
      case 7:
        code.word(R(high)).set(A).i32(byte).set(B);
        if (op >>> 11 === 6) this.add();
        else this.subtract();
        code.get(RES);
        this.write(high);
        break;
      case 8:
        if (op & 0x400) {
          this.highRegisters(op, instruction);
          return;
        }
        this.processing((op >> 6) & 15, low, middle);
        break;
      case 9:
        this.literal(high, ((pc + 4) & ~3) + (byte << 2), cost);
        return;
      case 10:
      case 11: {
        code.word(R(middle)).word(R((op >> 6) & 7)).op('add').i32(-RAM_BASE).op('add').tee(A);
        this.spent += cost;
        const kinds = [[32], [16], [8], [8, 'extend8'], [32], [16], [8], [16, 'extend16']];
        const which = (op >> 9) & 7;
        if (which < 3) this.store(kinds[which][0], low);
        else this.load(kinds[which][0], low, kinds[which][1]);
        return;
      }
      case 12:
      case 13:
      case 14:
      case 15:
      case 16:
      case 17: {
        const bits = [32, 8, 16][((op >>> 11) - 12) >> 1];
        code.word(R(middle)).i32((((op >> 6) & 31) << SHIFT[bits]) - RAM_BASE).op('add').tee(A);
        this.spent += cost;
        if (op & 0x800) this.load(bits, low);
        else this.store(bits, low);
        return;
      }
      case 18:
      case 19:
        code.word(R(13)).i32((byte << 2) - RAM_BASE).op('add').tee(A);
        this.spent += cost;
        if (op & 0x800) this.load(32, high);
        else this.store(32, high);
        return;
      case 20:
        code.i32(((pc + 4) & ~3) + (byte << 2));
        this.write(high);
        break;
      case 21:
        code.word(R(13)).i32(byte << 2).op('add');
        this.write(high);
        break;
      case 22:
      case 23:
        if (this.miscellaneous(op, low, middle, cost)) return;
        break;
      case 24:
      case 25:
        this.multiple(op & 0x800, high, byte);
        break;
      case 26:
      case 27:
        this.condition((op >> 8) & 15);
        code.if();
        this.spent += 2;
        this.branch(target);
        this.spent -= 2;
        code.end();
        break;
      case 28:
        this.spent += cost;
        this.branch(target);
        return;
      case 30:
        this.spent += cost;
        if (kind === 'call') {
          code.i32(this.next | 1);
          this.write(14);
          this.branch(target);
        }
        return;
    }
    this.spent += cost;
  }

  shift(kind, d, m, amount) {
    const { code, need } = this;
    code.word(R(m)).set(B);
    const by = amount || 32;
    if (need & FLAGS.c && (kind || amount)) {
      code.get(B).i32(kind ? by - 1 : 32 - by).op('shrU').i32(1).op('and').put(AT.c, X);
    }
    if (kind === 0) code.get(B).i32(amount).op('shl');
    else if (kind === 1 && amount) code.get(B).i32(amount).op('shrU');
    else if (kind === 1) code.i32(0);
    else code.get(B).i32(Math.min(by, 31)).op('shrS');
    if (need & FLAGS.nz) code.tee(RES).put(AT.nz, X).get(RES);
    this.write(d);
  }

  /** RES = A + B, and the flags. */
  add() {
    const { code, need } = this;
    code.get(A).get(B).op('add').set(RES);
    if (need & FLAGS.nz) code.get(RES).put(AT.nz, X);
    if (need & FLAGS.c) code.get(RES).get(A).op('ltU').put(AT.c, X);
    if (need & FLAGS.v) code.get(A).get(RES).op('xor').get(B).get(RES).op('xor', 'and').i32(31).op('shrU').put(AT.v, X);
  }

  /** RES = A - B, and the flags. */
  subtract() {
    const { code, need } = this;
    code.get(A).get(B).op('sub').set(RES);
    if (need & FLAGS.nz) code.get(RES).put(AT.nz, X);
    if (need & FLAGS.c) code.get(A).get(B).op('geU').put(AT.c, X);
    if (need & FLAGS.v) code.get(A).get(B).op('xor').get(A).get(RES).op('xor', 'and').i32(31).op('shrU').put(AT.v, X);
  }

  /** RES = A + B + C, and the flags. */
  addWithCarry() {
    const { code, need } = this;
    code.get(A).get(B).op('add').word(AT.c).op('add').set(RES);
    if (need & FLAGS.nz) code.get(RES).put(AT.nz, X);
    if (need & FLAGS.v) code.get(A).get(RES).op('xor').get(B).get(RES).op('xor', 'and').i32(31).op('shrU').put(AT.v, X);
    if (need & FLAGS.c) {
      code.get(A).op('extendI64').get(B).op('extendI64').op('i64Add').word(AT.c).op('extendI64').op('i64Add');
      code.i64(0xffffffffn).op('i64GtU').put(AT.c, X);
    }
  }

  processing(kind, d, m) {
    const { code, need } = this;
    const flag = () => (need & FLAGS.nz ? code.tee(RES).put(AT.nz, X).get(RES) : code);
    code.word(R(d)).set(A).word(R(m)).set(B);
    switch (kind) {
      case 0:
        code.get(A).get(B).op('and');
        flag();
        break;
      case 1:
        code.get(A).get(B).op('xor');
        flag();
        break;
      case 2:
      case 3:
      case 4:
        this.shiftBy(kind);
        code.get(RES);
        flag();
        break;
      case 5:
      case 6:
        if (kind === 6) code.get(B).i32(-1).op('xor').set(B);
        this.addWithCarry();
        code.get(RES);
        break;
      case 7: // the amount 0 leaves C alone
        code.get(A).get(B).op('rotr').set(RES);
        if (need & FLAGS.c) {
          code.get(B).i32(255).op('and').if();
          code.get(RES).i32(31).op('shrU').put(AT.c, X);
          code.end();
        }
        code.get(RES);
        flag();
        break;
      case 8:
        if (need & FLAGS.nz) code.get(A).get(B).op('and').put(AT.nz, X);
        return;
      case 9:
        code.i32(0).set(A);
        this.subtract();
        code.get(RES);
        break;
      case 10:
        this.subtract();
        return;
      case 11:
        this.add();
        return;
      case 12:
        code.get(A).get(B).op('or');
        flag();
        break;
      case 13:
        code.get(A).get(B).op('mul');
        flag();
        break;
      case 14:
        code.get(A).get(B).i32(-1).op('xor', 'and');
        flag();
        break;
      case 15:
        code.get(B).i32(-1).op('xor');
        flag();
        break;
    }
    this.write(d);
  }

  /** RES = A shifted left (2), right (3) or arithmetically right (4) by the low byte of B, and C. */
  shiftBy(kind) {
    const { code, need } = this;
    const carry = need & FLAGS.c;
    code.get(A).set(RES);
    code.get(B).i32(255).op('and').tee(B).if();
    code.get(B).i32(32).op('ltU').if();
    if (carry) {
      if (kind === 2) code.get(A).i32(32).get(B).op('sub', 'shrU');
      else code.get(A).get(B).i32(1).op('sub', 'shrU');
      code.i32(1).op('and').put(AT.c, X);
    }
    code.get(A).get(B).op(['shl', 'shrU', 'shrS'][kind - 2]).set(RES);
    code.op('else');
    if (kind === 4) {
      if (carry) code.get(A).i32(31).op('shrU').put(AT.c, X);
      code.get(A).i32(31).op('shrS').set(RES);
    } else {
      if (carry) {
        code.get(A);
        if (kind === 2) code.i32(1).op('and');
        else code.i32(31).op('shrU');
        code.get(B).i32(32).op('eq', 'and').put(AT.c, X);
      }
      code.i32(0).set(RES);
    }
    code.end().end();
  }

  highRegisters(op, { cost, kind }) {
    const { code, pc } = this;
    const source = (op >> 3) & 15;
    const d = ((op >> 4) & 8) | (op & 7);
    const value = (n) => (n === 15 ? code.i32(pc + 4) : code.word(R(n)));
    const which = (op >> 8) & 3;
    if (which === 1) {
      value(d).set(A);
      value(source).set(B);
      this.subtract();
      this.spent += cost;
      return;
    }
    if (which === 3) {
      if (kind === 'call') {
        code.word(R(source)).set(T);
        code.i32(this.next | 1);
        this.write(14);
      } else {
        // an exception's return, or an error
        code.word(R(source)).tee(T).i32(1).op('and').op('i32Eqz');
        code.get(T).i32(28).op('shrU').i32(15).op('eq', 'or').if();
        this.end(pc, LEFT.bail);
        code.end();
      }
      this.spent += cost;
      code.get(T).i32(~1).op('and');
      this.end(null, LEFT.jump);
      return;
    }
    value(source);
    if (which === 0) {
      value(d);
      code.op('add');
    }
    this.spent += cost;
    if (d === 15) {
      code.i32(~1).op('and');
      this.end(null, LEFT.jump);
      return;
    }
    if (d === 13) code.i32(~3).op('and');
    this.write(d);
  }

  /** Returns whether the cycles have been counted. */
  miscellaneous(op, d, m, cost) {
    const { code, pc } = this;
    switch ((op >> 8) & 15) {
      case 0:
        code.word(R(13)).i32(op & 0x80 ? -((op & 0x7f) << 2) : (op & 0x7f) << 2).op('add');
        this.write(13);
        return false;
      case 2:
        code.word(R(m));
        switch ((op >> 6) & 3) {
          case 0:
            code.op('extend16');
            break;
          case 1:
            code.op('extend8');
            break;
          case 2:
            code.i32(0xffff).op('and');
            break;
          case 3:
            code.i32(0xff).op('and');
            break;
        }
        this.write(d);
        return false;
      case 4:
      case 5: {
        const count = popcount(op & 0x1ff);
        if (!count) return false;
        code.word(R(13)).i32(4 * count).op('sub').set(T);
        this.inRamOrEnd(count);
        let offset = 0;
        for (let n = 0; n < 8; n++) {
          if (op & (1 << n)) {
            code.get(A).word(R(n)).memory('store', AT.ram + offset);
            offset += 4;
          }
        }
        if (op & 0x100) code.get(A).word(R(14)).memory('store', AT.ram + offset);
        code.get(T);
        this.write(13);
        return false;
      }
      case 10:
        code.word(R(m)).set(B);
        switch ((op >> 6) & 3) {
          case 0:
            code.get(B).i32(8).op('rotr').i32(0xff00ff00 | 0).op('and');
            code.get(B).i32(24).op('rotr').i32(0x00ff00ff).op('and', 'or');
            break;
          case 1:
            code.get(B).i32(0x00ff00ff).op('and').i32(8).op('shl');
            code.get(B).i32(8).op('shrU').i32(0x00ff00ff).op('and', 'or');
            break;
          case 3:
            code.get(B).i32(8).op('shl').get(B).i32(8).op('shrU').i32(0xff).op('and', 'or').op('extend16');
            break;
        }
        this.write(d);
        return false;
      case 12:
      case 13: {
        const count = popcount(op & 0x1ff);
        code.word(R(13)).set(T);
        this.inRamOrEnd(count);
        if (op & 0x100) {
          // an exception's return
          code.get(A).memory('load', AT.ram + 4 * (count - 1)).tee(B).i32(28).op('shrU').i32(15).op('eq').if();
          this.end(pc, LEFT.bail);
          code.end();
        }
        let offset = 0;
        for (let n = 0; n < 8; n++) {
          if (op & (1 << n)) {
            code.get(A).memory('load', AT.ram + offset);
            this.write(n);
            offset += 4;
          }
        }
        code.get(T).i32(4 * count).op('add');
        this.write(13);
        if (!(op & 0x100)) return false;
        this.spent += cost;
        code.get(B).i32(~1).op('and');
        this.end(null, LEFT.jump);
        return true;
      }
    }
    return false; // a hint that does nothing
  }

  /** A = T as an offset in RAM; the interpreter takes over if not all of the words from there are in RAM. */
  inRamOrEnd(count) {
    const { code } = this;
    code.get(T).i32(RAM_BASE).op('sub').tee(A).i32(2).op('shrU').get(A).i32(30).op('shl', 'or');
    code.i32(RAM_SIZE / 4 - count).op('gtU').if();
    this.end(this.pc, LEFT.bail);
    code.end();
  }

  multiple(load, base, list) {
    const { code } = this;
    const count = popcount(list);
    code.word(R(base)).set(T);
    this.inRamOrEnd(count);
    let offset = 0;
    for (let n = 0; n < 8; n++) {
      if (!(list & (1 << n))) continue;
      if (load) {
        code.get(A).memory('load', AT.ram + offset);
        this.write(n);
      } else {
        code.get(A).word(R(n)).memory('store', AT.ram + offset);
      }
      offset += 4;
    }
    if (load && list & (1 << base)) return;
    code.get(T).i32(4 * count).op('add');
    this.write(base);
  }

  condition(number) {
    const { code } = this;
    const signs = () => code.word(AT.nz).i32(31).op('shrU').word(AT.v);
    switch (number >> 1) {
      case 0:
        code.word(AT.nz);
        if (!(number & 1)) code.op('i32Eqz');
        return;
      case 1:
        code.word(AT.c);
        break;
      case 2:
        code.word(AT.nz).i32(31).op('shrU');
        break;
      case 3:
        code.word(AT.v);
        break;
      case 4:
        code.word(AT.c).word(AT.nz).i32(0).op('ne', 'and');
        break;
      case 5:
        signs().op('eq');
        break;
      case 6:
        signs().op('eq').word(AT.nz).i32(0).op('ne', 'and');
        break;
    }
    if (number & 1) code.op('i32Eqz');
  }

  // ---------------------------------------------------------------- memory

  /** Load from a constant address. */
  literal(d, address, cost) {
    const { code } = this;
    this.spent += cost;
    if (this.inRam) {
      code.i32(address - RAM_BASE).tee(A);
      this.load(32, d);
      return;
    }
    const line = (address & 0xffffff) >>> 3;
    code.word(AT.flash + (address & (FLASH_SIZE - 1)));
    this.write(d);
    this.touchIf(line);
    code.i32(line).call(MISS);
    this.checkAgain();
    code.end();
  }

  /** After an access that may take longer than thought or change the limit. */
  checkAgain() {
    if (this.last) return; // the next block checks
    this.overLimit().if();
    this.end(this.next, LEFT.bail);
    this.code.end();
  }

  /** Register d = what is at A, an offset from RAM_BASE, which is on the stack as well. */
  load(bits, d, extend) {
    const { code } = this;
    const [slow, load] = LOADS[bits];
    this.inRamIf(bits);
    code.get(A).memory(load, AT.ram);
    if (extend) code.op(extend);
    this.write(d);
    code.op('else');
    code.get(A);
    this.sofar().call(slow);
    if (extend) code.op(extend);
    this.write(d);
    this.checkAgain();
    code.end();
  }

  store(bits, d) {
    const { code } = this;
    const [slow, store] = STORES[bits];
    this.inRamIf(bits);
    code.get(A).word(R(d)).memory(store, AT.ram);
    code.op('else');
    code.get(A);
    this.sofar().word(R(d)).call(slow);
    this.checkAgain();
    code.end();
  }

  inRamIf(bits) {
    const { code } = this;
    // a rotation would do, but is a call in code that V8 has not optimized
    if (bits > 8) code.i32(SHIFT[bits]).op('shrU').get(A).i32(32 - SHIFT[bits]).op('shl', 'or');
    code.i32((RAM_SIZE * 8) / bits).op('ltU').if();
  }

  /** What a slow access has to know: the cycles and the lines so far. */
  sofar() {
    return this.code.i32(this.spent | (this.lines << 16));
  }
}

/** Make a module that exports translated code, as "0" and so on. */
export function moduleOf(regions) {
  const exported = regions.map((_, i) => [String(i), CODE_TYPE]);
  return moduleMaker(TYPES, IMPORTS, exported)(...regions.map(({ code }) => [code, LOCALS]));
}

/**
 * Translate the code at an address.
 * @param code all halfwords of the flash or of the RAM, which begins at `base`
 * @returns {binary, leaders, source, first}: a module that exports `code`; the halfwords that were translated, and the
 *     index of the first one; or null
 */
export function translate(code, seen, base, start, firstEnd) {
  return new Translation(code, seen, base, start, firstEnd).function();
}
