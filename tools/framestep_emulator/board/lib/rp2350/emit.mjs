// Armv8-M mainline (Cortex-M33) code as text for assemble.mjs. Code is run in pieces, from an address to the next jump that is always
// taken. A piece is a list of steps: each instruction's text (of 16 bits in thumb.mjs) is that of a function, which all places with the
// same instruction share. A piece that runs often becomes one function: its text has the same meanings with what is known of the place.
//
// IT blocks are resolved here: an instruction in one gets its condition, so the state of IT exists at no other time.

import { FLASH_BASE, RAM_BASE } from '../layout.mjs';
import { COND, LONGEST, Thumb, s32 } from '../thumb.mjs';

export const RAM_SIZE = 0x82000;

/** Words that the text knows by name: cycles and their limit, the flags as in Processor; Q; the exclusive monitor; the high word of a product;
 * CONTROL.FPCA; the lowest stack pointer; GE; FPSCR. */
export const STATE = {
  cycles: 0, limit: 1, nz: 2, c: 3, v: 4, sticky: 5, monitor: 6, high: 7, fpca: 8, floor: 9, ge: 10, fpscr: 11,
};
/** Others, which mean nothing between two stretches. Of a step: its address, cycles of the piece up to it, the number in it. Of a list of steps:
 * whether it is to end at the limit; the step where it has, or 0. */
export const SCRATCH = { here: 0, cy: 1, to: 2, stopping: 3, stop: 4 };

// Cycles: Arm publishes no table for the M33. These follow its pipeline; the README says how they compare with a real board.
const USE = 1; // on top of 1, of an instruction that reads what the one before it has loaded
const TAKEN = 2; // on top of 1
const DIVIDE = 7;

/** ThumbExpandImm: [value, carry or -1]. */
function expand(i12) {
  const low = i12 & 0xff;
  if (!(i12 & 0xc00)) {
    switch ((i12 >> 8) & 3) {
      case 0: return [low, -1];
      case 1: return [low | (low << 16), -1];
      case 2: return [(low << 8) | (low << 24), -1];
      default: return [(low * 0x01010101) | 0, -1];
    }
  }
  const n = i12 >> 7;
  const x = 0x80 | (i12 & 0x7f);
  const value = (x >>> n) | (x << (32 - n));
  return [value, (value >>> 31) & 1];
}

// Floating-point instructions of three registers, and cycles on top of 1
const OF_THREE = [
  ['vmla', 2], ['vmls', 2], ['vnmls', 2], ['vnmla', 2], ['vmul', 0], ['vnmul', 0], ['vadd', 0], ['vsub', 0], ['vdiv', 13], null,
  ['vfnms', 2], ['vfnma', 2], ['vfma', 2], ['vfms', 2],
];

export class Emitter extends Thumb {
  #instructions = new Map();

  /** @param fetch a function: address -> halfword; flash: the memory, as a DataView */
  constructor(fetch, flash) {
    super(fetch, TAKEN);
    this.flash = flash;
  }

  /** The steps of the piece at `start`, the address after it, and the most cycles that it takes, misses of the cache apart. `cycles`: those before
   * the step; `use`: it has to wait for what the one before it loads; `place`: the piece can end or begin there; `fresh`, `second`: it begins in
   * another line of the flash, goes on in the next one. */
  steps(start) {
    const inFlash = start >>> 24 === 0x10;
    const steps = [];
    let it = []; // conditions of the next instructions
    let wasIT = false;
    let pc = start;
    let cycles = 0;
    let line = -1;
    let loaded = 0; // registers
    for (let ended = false; !ended; ) {
      const place = !it.length;
      if (steps.length >= LONGEST && place) {
        steps.push({ pc, what: this.leaving, cycles });
        break;
      }
      const h = this.fetch(pc);
      const wide = h >>> 11 >= 0x1d;
      const g = wide ? this.fetch(pc + 2) : 0;
      const cond = it.shift() ?? 14;
      const inIT = cond !== 14 || wasIT;
      const what = this.instruction(h, g, cond, inIT, !it.length);
      const use = what.reads & loaded ? USE : 0;
      const last = (pc + (wide ? 2 : 0)) >>> 3;
      const fresh = inFlash && pc >>> 3 !== line;
      const second = inFlash && last !== pc >>> 3;
      steps.push({ pc, h, g, wide, cond, inIT, lastInIT: !it.length, what, cycles, use, place, fresh, second });
      line = last;
      loaded = what.loads;
      cycles += 1 + use + what.more;
      if (place) it = [...what.it];
      wasIT = it.length > 0;
      ended = what.ended;
      pc += wide ? 4 : 2;
    }
    return { steps, end: pc, max: cycles + TAKEN };
  }

  /** What a step does: its text for wherever it is, its cycles on top of 1, registers that it reads and loads, ... */
  instruction(h, g, cond, inIT, lastInIT) {
    const key = (((cond * 2 + inIT) * 2 + lastInIT) * 65536 + g) * 65536 + h;
    let what = this.#instructions.get(key);
    if (!what) {
      Object.assign(this, { quick: false, pc: 0, cy: 0, start: null });
      const text = this.meaning(h, g, cond, inIT, lastInIT);
      const { cy: more, reads, ended, it, movesStack, to, leads } = this;
      what = { text: text + (ended ? '' : 'return -1;'), more, reads, loads: this.loads ? this.sets : 0, ended, it, movesStack, to, leads };
      this.#instructions.set(key, what);
    }
    return what;
  }
  get leaving() {
    Object.assign(this, { quick: false, cy: -1, out: [], leads: [] });
    this.exit(0);
    return { text: this.out.join(''), to: 0, leads: [0] };
  }

  meaning(h, g, cond, inIT, lastInIT) {
    const wide = h >>> 11 >= 0x1d;
    Object.assign(this, { inIT, out: [], it: [], reads: 0, sets: 0, loads: false, ended: false, fence: false, movesStack: false, to: 0, leads: [] });
    this.next = this.pc + (wide ? 4 : 2);
    if (wide) this.wide(h, g);
    else this.narrow(h);
    if (cond === 14) return this.out.join('');
    this.out = [`if(${COND[cond]}){${this.out.join('')}}`];
    if (this.ended) {
      this.ended = false; // only if the condition holds
      if (lastInIT && this.fence) this.exit(this.next);
    }
    return this.out.join('');
  }

  /** The piece at `start` as one function: its text, and the last address in the flash that it depends on. */
  piece(start) {
    const { steps, end, max } = this.steps(start);
    const movesStack = steps.some(({ what }) => what.movesStack);
    let last = end;
    let loops = false;
    const line = (at) => {
      const index = (at & (this.flash.byteLength - 1)) >>> 3;
      return `x=present[${index}];if(x===0)core.miss(${index});else used[${index & 1023}]=x;`;
    };
    const text = steps.map(({ pc, h, g, cond, inIT, lastInIT, cycles, use, fresh, second }) => {
      Object.assign(this, { quick: true, pc, start, cy: cycles, last: 0, loops: false, out: [] });
      if (h === undefined) {
        this.exit(pc);
        return this.out.join('');
      }
      this.cy += 1 + use;
      const meaning = this.meaning(h, g, cond, inIT, lastInIT);
      last = Math.max(last, this.last);
      loops ||= this.loops;
      return (fresh ? line(pc) : '') + (second ? line(pc + 2) : '') + meaning;
    });
    const all = text.join('').replaceAll('@CHECK@', movesStack ? 'if(r13<floor)core.overflow();' : '').replaceAll('@MAX@', max);
    return { text: (start >>> 24 === 0x20 ? this.changed(start, end) : '') + (loops ? `L:for(;;){${all}}` : all), last };
  }

  /** Leave if the code in RAM is another one now. */
  changed(start, end) {
    const differences = [];
    for (let at = start & ~3; at < end; at += 4) differences.push(`m32[${at - RAM_BASE}]!==${this.fetch(at) | (this.fetch(at + 2) << 16)}`);
    return `if(${differences.join('||')})return core.stale(${start});`;
  }

  // ------------------------------------------------------------------ pieces of text

  /** Cycles of the piece up to here, as text. */
  spent(extra = 0) {
    return `${this.quick ? '' : 'cy+'}${this.cy + extra}`;
  }
  /** An address at a distance from this instruction (the program counter of one that is shared is 0). */
  at(address) {
    return this.quick ? `${address | 0}` : `here+${address}`;
  }
  /** Another one, which differs between places. */
  target(address) {
    if (this.quick) return `${address | 0}`;
    this.to = address;
    return 'here+to';
  }
  ahead(offset, aligned = false) {
    if (!aligned || this.quick) return super.ahead(offset, aligned);
    if (offset !== 'to') this.to = offset;
    this.to += 4;
    return '((here&-4)+to)';
  }
  /** A number, which differs between places as well. */
  imm(value) {
    if (this.quick) return value;
    this.to = value;
    return 'to';
  }
  field(h, at, bits, scale = 1) {
    const value = super.field(h, at, bits, scale);
    return bits > 3 ? this.imm(value) : value;
  }
  amount(h) {
    return (h >> 6) & 31;
  }
  link14() {
    return this.at(this.next | 1);
  }

  r(n) {
    if (n === 15) return `(${this.at(this.pc + 4)})`;
    this.reads |= 1 << n;
    return `r${n}`;
  }
  set(n, text) {
    this.sets |= 1 << n;
    this.movesStack ||= n === 13;
    this.e(`r${n}=${text};`);
  }
  /** Leave for an address. */
  exit(target, extra = 0) {
    this.leads.push(target);
    this.exitTo(this.target(target), extra);
  }
  exitTo(text, extra = 0) {
    this.e(`${this.quick ? '@CHECK@' : ''}cycles+=${this.spent(extra)};return ${text};`);
    this.ended = true;
  }
  /** Jump to a known address; a jump to the start of this piece stays in it. */
  jump(target, extra = this.taken) {
    if (target !== this.start) return this.exit(target, extra);
    this.loops = true;
    this.e(`cycles+=${this.spent(extra)};if(cycles+@MAX@<=limit)continue L;@CHECK@return ${target};`);
    this.ended = true;
  }
  undefined(h, h2 = -1) {
    this.exitTo(`core.undefined(${this.at(this.pc)},${h},${h2})`);
  }
  /** An operation of the core that may change anything. */
  call(text) {
    this.e(`r15=${this.at(this.next)};`);
    this.exitTo(text);
    this.fence = true;
  }

  /** If o is the place of an element in the RAM, or the first of some. */
  inside(size, elements = 1) {
    const shift = { 32: 2, 16: 1, 8: 0 }[size];
    return `${shift ? `(o>>>${shift}|o<<${32 - shift})` : 'o'}>>>0<=${(RAM_SIZE >> shift) - elements}`;
  }
  load(size, address, signed = false) {
    this.loads = true;
    const extended = (text) => (signed ? `(${text}<<${32 - size}>>${32 - size})` : text);
    if (address.startsWith('#')) {
      address = address.slice(1);
      if (!this.quick) return extended(`core.literal${size}(${address},${this.spent()})`);
      if (address >>> 24 === 0x10 && !(size === 32 && address & 3)) return `${this.literal(Number(address), size, signed)}`;
    }
    this.e(`o=${address}-${RAM_BASE};`);
    return extended(`(${this.inside(size)}?m${size}[o]:core.ld${size}(o+${RAM_BASE},${this.spent()}))`);
  }
  literal(at, size, signed) {
    const offset = at & (this.flash.byteLength - 1);
    this.last = Math.max(this.last, FLASH_BASE + offset + 4);
    if (size === 32) return this.flash.getInt32(offset, true);
    const value = size === 16 ? this.flash.getUint16(offset & ~1, true) : this.flash.getUint8(offset);
    return signed ? s32(value, size) : value;
  }
  store(size, address, value) {
    this.e(`o=${address}-${RAM_BASE};if(${this.inside(size)})m${size}[o]=${value};else core.st${size}(o+${RAM_BASE},${value},${this.spent()});`);
  }

  loadTo(d, size, address, signed = false) {
    this.set(d, this.load(size, address, signed));
  }

  /** Jump to a value that tells the state (BX, POP, LDR). */
  bx(text, extra = this.taken) {
    this.exitTo(`(${text})&-2`, extra);
  }

  breakpoint(h) {
    this.call(`core.bkpt(${h & 0xff},${this.at(this.pc)})`);
  }

  hint(h) {
    const mask = h & 15;
    const first = (h >> 4) & 15;
    if (!mask) {
      if (first === 2) this.call('core.wfe()');
      else if (first === 3) this.call('core.wfi()');
      else if (first === 4) this.call('core.sev()');
      return;
    }
    const count = 4 - (31 - Math.clz32(mask & -mask));
    this.it = [];
    for (let i = 0; i < count; i++) {
      this.it.push(i === 0 ? first : (first & 14) | ((mask >> (4 - i)) & 1));
    }
  }

  /** LDM, STM, PUSH, POP. before: the first address is below the base. */
  multiple(n, list, load, writeback, before) {
    let count = 0;
    for (let i = list; i; i &= i - 1) count++;
    this.cy += count;
    this.e(`b=${this.r(n)}${before ? `-${4 * count}` : ''};`);
    const after = before ? 'b' : `b+${4 * count}`;
    let fast = '';
    let slow = '';
    let at = 0;
    for (let k = 0; k < 16; k++) {
      if (!((list >> k) & 1)) continue;
      if (load) {
        const to = k === 15 ? 't' : `r${k}`;
        if (k < 15) {
          this.movesStack ||= k === 13;
          this.sets = 1 << k;
          this.loads = true;
        }
        fast += `${to}=m32[o+${at}];`;
        slow += `${to}=core.ld32(b+${at},${this.spent()});`;
      } else {
        fast += `m32[o+${at}]=${this.r(k)};`;
        slow += `core.st32(b+${at},${this.r(k)},${this.spent()});`;
      }
      at += 4;
    }
    this.e(`o=b-${RAM_BASE};if(${this.inside(32, count)}){${fast}}else{${slow}}`);
    if (writeback && !(load && (list >> n) & 1)) {
      this.movesStack ||= n === 13;
      this.e(`r${n}=${after};`);
    }
    if (load && list >>> 15) this.bx('t');
  }

  // ------------------------------------------------------------------ 32 bits

  wide(h, g) {
    const op = (h >> 11) & 3;
    if (op === 1) {
      if ((h & 0xfe40) === 0xe800) this.multipleWide(h, g);
      else if ((h & 0xfe40) === 0xe840) this.dual(h, g);
      else if ((h & 0xfe00) === 0xea00) this.shifted(h, g);
      else this.coprocessor(h, g);
    } else if (op === 2) {
      if (g & 0x8000) this.branches(h, g);
      else if (h & 0x200) this.plain(h, g);
      else this.modified(h, g);
    } else {
      if (h & 0x400) this.coprocessor(h, g);
      else if ((h & 0xfe00) === 0xf800) this.single(h, g);
      else if ((h & 0xff00) === 0xfa00) this.byRegister(h, g);
      else if ((h & 0xff80) === 0xfb00) this.multiply(h, g);
      else if ((h & 0xff80) === 0xfb80) this.multiplyLong(h, g);
      else this.undefined(h, g);
    }
  }

  multipleWide(h, g) {
    const n = h & 15;
    const load = !!(h & 0x10);
    const writeback = !!(h & 0x20);
    const op = (h >> 7) & 3;
    if (op === 1) this.multiple(n, g, load, writeback, false);
    else if (op === 2) this.multiple(n, g, load, writeback, true);
    else this.undefined(h, g);
  }

  dual(h, g) {
    const n = h & 15;
    const t = g >> 12;
    const t2 = (g >> 8) & 15;
    const P = h & 0x100;
    const U = h & 0x80;
    const W = h & 0x20;
    const L = h & 0x10;
    if (P || W) {
      // LDRD, STRD
      const offset = (U ? 1 : -1) * 4 * (g & 0xff);
      const literal = n === 15;
      const base = literal ? this.ahead(offset, true) : this.r(n);
      this.cy += 1;
      this.e(`b=${base}${P && !literal ? `+${this.imm(offset)}` : ''};`);
      if (L) {
        this.e(`t=${this.load(32, 'b')};`);
        const second = this.load(32, 'b+4');
        this.set(t2, second);
        this.set(t, 't');
      } else {
        this.store(32, 'b', this.r(t));
        this.store(32, 'b+4', this.r(t2));
      }
      if (W) this.set(n, P ? 'b' : `b+${this.imm(offset)}`);
      return;
    }
    if (!(h & 0x80)) {
      if (h & 0x10) {
        // LDREX
        this.set(t, this.load(32, `${this.r(n)}+${4 * (g & 0xff)}`));
        this.e('monitor=1;');
      } else if (g >> 12 === 15 && n !== 15 && (h & 0xfff0) === 0xe840 && (g & 0x3f) === 0) {
        // TT, TTT, TTA, TTAT: everything is secure and accessible
        this.set(t2, 'core.tt()');
      } else {
        // STREX
        this.e('if(monitor){monitor=0;');
        this.store(32, `${this.r(n)}+${4 * (g & 0xff)}`, this.r(t));
        this.set(t2, '0');
        this.e('}else{');
        this.set(t2, '1');
        this.e('}');
      }
      return;
    }
    const kind = (g >> 4) & 15;
    if (L && kind < 2) {
      // TBB, TBH
      const base = this.r(n);
      const m = g & 15;
      this.cy += USE;
      const text = kind ? this.load(16, `${base}+(${this.r(m)}<<1)`) : this.load(8, `${base}+${this.r(m)}`);
      this.exitTo(`${this.at(this.pc + 4)}+(${text}<<1)`, TAKEN);
      return;
    }
    const size = [8, 16, 32, 0][kind & 3];
    if (size && kind >= 4) {
      this.cy += 1;
      const exclusive = kind < 8 || kind >= 12;
      if (L) {
        this.set(t, this.load(size, this.r(n)));
        if (exclusive) this.e('monitor=1;');
      } else if (!exclusive) this.store(size, this.r(n), this.r(t));
      else {
        this.e('if(monitor){monitor=0;');
        this.store(size, this.r(n), this.r(t));
        this.set(g & 15, '0');
        this.e('}else{');
        this.set(g & 15, '1');
        this.e('}');
      }
      return;
    }
    this.undefined(h, g);
  }

  /** The common part of data processing. b: text of the second operand. carry: it has set c already. */
  process(op, S, n, d, b, h, g) {
    const a = () => this.r(n);
    const logic = (text) => {
      if (d === 15 && S) this.nz(`(${text})|0`);
      else {
        this.write(d, `(${text})|0`);
        if (S) this.nz(`r${d}`);
      }
    };
    switch (op) {
      case 0: logic(`${a()}&${b}`); return; // AND, TST
      case 1: logic(`${a()}&~(${b})`); return; // BIC
      case 2: logic(n === 15 ? b : `${a()}|${b}`); return; // ORR, MOV
      case 3: logic(n === 15 ? `~(${b})` : `${a()}|~(${b})`); return; // ORN, MVN
      case 4: logic(`${a()}^${b}`); return; // EOR, TEQ
      case 8:
        if (S) { this.addFlags(a(), b); if (d !== 15) this.set(d, 'x'); } else this.write(d, `(${a()}+${b})|0`);
        return;
      case 10:
        if (S) { this.adcFlags(a(), b); this.set(d, 'x'); } else this.set(d, `(${a()}+${b}+c)|0`);
        return;
      case 11:
        if (S) { this.adcFlags(a(), `~(${b})`); this.set(d, 'x'); } else this.set(d, `(${a()}+~(${b})+c)|0`);
        return;
      case 13:
        if (S) { this.subFlags(a(), b); if (d !== 15) this.set(d, 'x'); } else this.write(d, `(${a()}-(${b}))|0`);
        return;
      case 14:
        if (S) { this.subFlags(b, a()); this.set(d, 'x'); } else this.set(d, `((${b})-${a()})|0`);
        return;
    }
    this.undefined(h, g);
  }

  shifted(h, g) {
    const op = (h >> 5) & 15;
    const S = !!(h & 0x10);
    const n = h & 15;
    const d = (g >> 8) & 15;
    const m = g & 15;
    const type = (g >> 4) & 3;
    const amount = ((g >> 10) & 0x1c) | ((g >> 6) & 3);
    if (op === 6) {
      // PKHBT, PKHTB
      const x = this.shift(type, amount, this.r(m), false);
      this.e(`y=${x};`);
      this.set(d, g & 0x20 ? `(${this.r(n)}&-65536)|(y&65535)` : `(${this.r(n)}&65535)|(y&-65536)`);
      return;
    }
    let x = this.shift(type, amount, this.r(m), S && op < 5);
    if (x === 'x' || x.includes('q')) {
      this.e(`w=${x};`);
      x = 'w';
    }
    this.process(op, S, n, d, x, h, g);
  }

  modified(h, g) {
    const op = (h >> 5) & 15;
    const S = !!(h & 0x10);
    const n = h & 15;
    const d = (g >> 8) & 15;
    const [value, carry] = expand(((h & 0x400) << 1) | ((g >> 4) & 0x700) | (g & 0xff));
    if (S && op < 5 && carry >= 0) {
      this.e(`c=${carry};`);
    }
    this.process(op, S, n, d, `(${this.imm(value)})`, h, g);
  }

  plain(h, g) {
    const op = (h >> 4) & 31;
    const n = h & 15;
    const d = (g >> 8) & 15;
    const i12 = ((h & 0x400) << 1) | ((g >> 4) & 0x700) | (g & 0xff);
    const i16 = ((h & 15) << 12) | i12;
    const lsb = ((g >> 10) & 0x1c) | ((g >> 6) & 3);
    const low = g & 31;
    switch (op) {
      case 0: this.set(d, n === 15 ? `${this.ahead(i12, true)}` : `(${this.r(n)}+${this.imm(i12)})|0`); return;
      case 10: this.set(d, n === 15 ? `${this.ahead(-i12, true)}` : `(${this.r(n)}-${this.imm(i12)})|0`); return;
      case 4: this.set(d, this.imm(i16)); return;
      case 12: this.set(d, `(${this.r(d)}&65535)|${this.imm((i16 << 16) | 0)}`); return;
      case 16: case 18: {
        if (op === 18 && lsb === 0) {
          this.set(d, `core.ssat16(${this.r(n)},${(low & 15) + 1})`); // SSAT16
          return;
        }
        const x = this.shift(op === 18 ? 2 : 0, lsb, this.r(n), false);
        this.set(d, `core.ssat(${x},${low + 1})`);
        return;
      }
      case 24: case 26: {
        if (op === 26 && lsb === 0) {
          this.set(d, `core.usat16(${this.r(n)},${low & 15})`); // USAT16
          return;
        }
        const x = this.shift(op === 26 ? 2 : 0, lsb, this.r(n), false);
        this.set(d, `core.usat(${x},${low})`);
        return;
      }
      case 20: this.set(d, `${this.r(n)}<<${31 - low - lsb}>>${31 - low}`); return; // SBFX: low is width - 1
      case 28: this.set(d, low === 31 ? this.r(n) : `(${this.r(n)}>>>${lsb})&${2 ** (low + 1) - 1 | 0}`); return;
      case 22: {
        // BFI, BFC: low is msb
        const mask = ((2 ** (low - lsb + 1) - 1) * 2 ** lsb) | 0;
        if (n === 15) this.set(d, `${this.r(d)}&${~mask}`);
        else this.set(d, `(${this.r(d)}&${~mask})|((${this.r(n)}<<${lsb})&${mask})`);
        return;
      }
    }
    this.undefined(h, g);
  }

  branches(h, g) {
    if (g & 0x1000) {
      const target = (this.pc + 4 + this.longOffset(h, g)) | 0;
      if (g & 0x4000) {
        // BL
        this.set(14, this.link14());
        this.leads.push(this.next);
      }
      this.jump(target);
      return;
    }
    if ((h & 0x380) !== 0x380) {
      const [S, j1, j2] = [(h >> 10) & 1, (g >> 13) & 1, (g >> 11) & 1];
      const offset = (S ? -0x100000 : 0) + (j2 << 19) + (j1 << 18) + ((h & 0x3f) << 12) + ((g & 0x7ff) << 1);
      this.branchIf((h >> 6) & 15, (this.pc + 4 + offset) | 0);
      return;
    }
    if ((h & 0xffe0) === 0xf380) {
      this.call(`core.msr(${g & 0xff},${this.r(h & 15)})`);
      return;
    }
    if (h === 0xf3ef) {
      this.e('back;');
      this.set((g >> 8) & 15, `core.mrs(${g & 0xff})`);
      return;
    }
    if (h === 0xf3bf) {
      const op = (g >> 4) & 15;
      if (op === 2) this.e('monitor=0;'); // CLREX
      else if (op === 6 || op === 4) this.exit(this.next); // ISB, DSB: interrupts are looked at
      return;
    }
    if (h === 0xf3af) return; // NOP.W and other hints
    this.undefined(h, g);
  }

  single(h, g) {
    const n = h & 15;
    const t = g >> 12;
    const signed = !!(h & 0x100);
    const size = [8, 16, 32, 0][(h >> 5) & 3];
    const L = !!(h & 0x10);
    if (!size) return this.undefined(h, g);
    let address;
    let after = null;
    if (n === 15) {
      if (t === 15 && size < 32) return; // PLD, PLI
      address = `#${this.ahead((h & 0x80 ? 1 : -1) * (g & 0xfff), true)}`;
    } else if (h & 0x80) address = `${this.r(n)}+${this.imm(g & 0xfff)}`;
    else if (!(g & 0x800)) address = `${this.r(n)}+(${this.r(g & 15)}<<${(g >> 4) & 3})`;
    else {
      const offset = this.imm((g & 0x200 ? 1 : -1) * (g & 0xff));
      const P = g & 0x400;
      const W = g & 0x100;
      if (W || !P) {
        this.e(`b=(${this.r(n)}+${offset})|0;`);
        address = P ? 'b' : this.r(n);
        after = 'b';
      } else address = `${this.r(n)}+${offset}`;
      if (P && g & 0x200 && !W) address = `${this.r(n)}+${this.imm(g & 0xff)}`; // LDRT and so on, as privileged
    }
    if (L && t === 15 && size < 32) return; // PLD, PLI
    if (L) {
      const text = this.load(size, address, signed);
      if (t === 15) {
        this.e(`t=${text};`);
        if (after) this.set(n, after);
        this.bx('t');
        return;
      }
      if (after) {
        this.e(`t=${text};`);
        this.set(n, after);
        this.set(t, 't');
      } else this.set(t, text);
    } else {
      this.store(size, address, this.r(t));
      if (after) this.set(n, after);
    }
  }

  byRegister(h, g) {
    const n = h & 15;
    const d = (g >> 8) & 15;
    const m = g & 15;
    const op = (h >> 4) & 15;
    if ((g & 0xf000) !== 0xf000) return this.undefined(h, g);
    if (op < 8 && (g & 0xf0) === 0) {
      // LSL, LSR, ASR, ROR
      const S = !!(h & 0x10);
      this.shiftBy((h >> 5) & 3, this.r(n), this.r(m), S);
      if (S) this.nz('x');
      this.set(d, 'x');
      return;
    }
    if (op < 8 && g & 0x80) {
      // extensions, with a rotation
      const rotation = ((g >> 4) & 3) * 8;
      this.e(`q=${this.r(m)};`);
      if (rotation) this.e(`q=(q>>>${rotation})|(q<<${32 - rotation});`);
      const text = ['q<<16>>16', 'q&65535', '((q<<24>>24)&65535)|(q<<8>>24<<16)', 'q&0xff00ff', 'q<<24>>24', 'q&255'][op];
      if (!text) return this.undefined(h, g);
      if (n === 15) this.set(d, text);
      else if (op === 2 || op === 3) this.set(d, `core.addHalves(${this.r(n)},${text})`);
      else this.set(d, `(${this.r(n)}+(${text}))|0`);
      return;
    }
    if (op >= 8 && !(g & 0x80)) {
      // parallel addition and subtraction
      this.set(d, `core.parallel(${op & 7},${(g >> 4) & 7},${this.r(n)},${this.r(m)})`);
      return;
    }
    if (op >= 8 && (g & 0xc0) === 0x80) {
      const kind = ((op & 3) << 2) | ((g >> 4) & 3);
      this.e(`x=${this.r(m)};`);
      switch (kind) {
        case 0: case 1: case 2: case 3: this.set(d, `core.qadd(${kind},${this.r(n)},x)`); return;
        case 4: this.set(d, '(x<<24)|((x&65280)<<8)|((x>>>8)&65280)|(x>>>24)'); return;
        case 5: this.set(d, '((x&0xff00ff)<<8)|((x>>>8)&0xff00ff)'); return;
        case 6: this.set(d, 'core.rbit(x)'); return;
        case 7: this.set(d, '((x<<24)|((x&65280)<<8))>>16'); return;
        case 8: this.set(d, `core.sel(${this.r(n)},x)`); return;
        case 12: this.set(d, 'Math.clz32(x)'); return;
      }
    }
    this.undefined(h, g);
  }

  multiply(h, g) {
    const n = h & 15;
    const a = g >> 12;
    const d = (g >> 8) & 15;
    const m = g & 15;
    const op = (h >> 4) & 7;
    const op2 = (g >> 4) & 3;
    const N = this.r(n);
    const M = this.r(m);
    const A = a === 15 ? 0 : this.r(a);
    const half = (text, top) => (top ? `(${text}>>16)` : `(${text}<<16>>16)`);
    switch (op) {
      case 0:
        if (op2 === 0) this.set(d, a === 15 ? `Math.imul(${N},${M})` : `(${this.r(a)}+Math.imul(${N},${M}))|0`);
        else this.set(d, `(${this.r(a)}-Math.imul(${N},${M}))|0`);
        return;
      case 1:
        this.set(d, `core.plus(${A},Math.imul(${half(N, op2 & 2)},${half(M, op2 & 1)}),0)`);
        return;
      case 2: case 4: {
        this.e(`q=${M};${op2 & 1 ? 'q=(q>>>16)|(q<<16);' : ''}p=${N};`);
        this.set(d, `core.plus(${A},Math.imul(p<<16>>16,q<<16>>16),${op === 4 ? '0-' : ''}Math.imul(p>>16,q>>16))`);
        return;
      }
      case 3:
        this.set(d, `core.plusTop(${N},${half(M, op2 & 1)},${A})`);
        return;
      case 5: this.set(d, `core.mulTop(${N},${M},${A},${op2 & 1},0)`); return;
      case 6: this.set(d, `core.mulTop(${N},${M},${this.r(a)},${op2 & 1},1)`); return;
      case 7: this.set(d, `core.usad(${N},${M},${A})`); return;
    }
    this.undefined(h, g);
  }

  multiplyLong(h, g) {
    const n = h & 15;
    const low = g >> 12;
    const high = (g >> 8) & 15;
    const m = g & 15;
    const op = (h >> 4) & 7;
    const op2 = (g >> 4) & 15;
    const N = this.r(n);
    const M = this.r(m);
    if (op === 1 && op2 === 15) {
      this.cy += DIVIDE - 1;
      this.set(high, `core.sdiv(${N},${M})`);
      return;
    }
    if (op === 3 && op2 === 15) {
      this.cy += DIVIDE - 1;
      this.set(high, `core.udiv(${N},${M})`);
      return;
    }
    const long = { 0: 'smull', 2: 'umull', 4: 'smlal', 6: 'umlal' }[op];
    if (long && (op2 === 0 || (op === 6 && op2 === 6))) {
      this.cy += 1;
      const name = op2 === 6 ? 'umaal' : long;
      const rest = name.endsWith('ull') ? '' : `,${this.r(low)},${this.r(high)}`;
      this.e(`p=core.${name}(${N},${M}${rest});`);
      this.set(low, 'p');
      this.set(high, 'high');
      return;
    }
    const halves = op === 4 && op2 >> 2 === 2; // SMLALBB and the like
    if (halves || ((op === 4 || op === 5) && op2 >> 1 === 6)) {
      const half = (text, top) => (top ? `(${text}>>16)` : `(${text}<<16>>16)`);
      this.e(`q=${M};p=${N};`);
      if (halves) this.e(`x=Math.imul(${half('p', op2 & 2)},${half('q', op2 & 1)});y=0;`);
      else {
        // SMLALD, SMLSLD
        if (op2 & 1) this.e('q=(q>>>16)|(q<<16);');
        this.e(`x=Math.imul(p<<16>>16,q<<16>>16);y=${op === 5 ? '0-' : ''}Math.imul(p>>16,q>>16);`);
      }
      this.e(`p=core.accumulate(x,y,${this.r(low)},${this.r(high)});`);
      this.set(low, 'p');
      this.set(high, 'high');
      return;
    }
    this.undefined(h, g);
  }

  // ------------------------------------------------------------------ coprocessors and the floating-point unit

  coprocessor(h, g) {
    const cp = (g >> 8) & 15;
    if (cp === 10 || cp === 11) {
      this.float(h, g, cp === 11);
      return;
    }
    const top = (h >> 4) & 0xff;
    const t = g >> 12;
    if ((h & 0xefe0) === 0xec40) {
      // MCRR, MRRC
      const op = (g >> 4) & 15;
      const t2 = h & 15;
      if (h & 0x10) {
        this.e(`p=core.mrrc(${cp},${op},${g & 15},${(h >> 12) & 1},${this.spent()});`);
        this.set(t, 'p');
        this.set(t2, 'high');
      } else this.e(`core.mcrr(${cp},${op},${g & 15},${this.r(t)},${this.r(t2)},${this.spent()});`);
      return;
    }
    if ((h & 0xef00) === 0xee00) {
      const op1 = (h >> 5) & 7;
      const op2 = (g >> 5) & 7;
      const args = `${h & 15},${g & 15},${op2}`;
      if (!(g & 0x10)) this.e(`core.cdp(${cp},${top & 15},${h & 15},${g & 15},${op2});`);
      else if (h & 0x10) {
        this.e(`x=core.mrc(${cp},${op1},${args},${(h >> 12) & 1});`);
        if (t === 15) {
          this.e('nz=x<0?-1:(x>>>30)&1?0:1;c=(x>>>29)&1;v=(x>>>28)&1;');
        } else this.set(t, 'x');
      } else this.e(`core.mcr(${cp},${op1},${args},${this.r(t)},${this.spent()});`);
      return;
    }
    this.undefined(h, g);
  }

  float(h, g, double) {
    this.e('fpca=4;');
    const D = (h >> 6) & 1;
    const Vd = (g >> 12) & 15;
    const d = double ? (D << 4) | Vd : (Vd << 1) | D;
    const n4 = h & 15;
    if ((h & 0xfe00) === 0xec00) {
      if ((h & 0x1e0) === 0x40) {
        // VMOV two registers
        const m = ((g & 15) << 1) | ((g >> 5) & 1);
        const at = double ? (((g >> 5) & 1) << 5) | ((g & 15) << 1) : m;
        const t = g >> 12;
        const t2 = h & 15;
        if (h & 0x10) {
          this.set(t, `si[${at}]`);
          this.set(t2, `si[${at + 1}]`);
        } else this.e(`si[${at}]=${this.r(t)};si[${at + 1}]=${this.r(t2)};`);
        return;
      }
      const P = h & 0x100;
      const U = h & 0x80;
      const W = h & 0x20;
      const L = h & 0x10;
      const imm = (g & 0xff) * 4;
      const first = double ? d * 2 : d;
      if (P && !W) {
        // VLDR, VSTR
        const base = this.r(n4);
        for (let i = 0; i < (double ? 2 : 1); i++) {
          const address = `${base}${U ? '+' : '-'}${this.imm(imm)}${i ? '+4' : ''}`;
          if (L) {
            const literal = n4 === 15 && this.ahead(U ? imm : -imm, true);
            const text = this.load(32, n4 === 15 ? `#${this.quick ? literal + 4 * i : `${literal}+${4 * i}`}` : address);
            this.e(`si[${first + i}]=${text};`);
          } else this.store(32, address, `si[${first + i}]`);
        }
        return;
      }
      // VLDM, VSTM, VPUSH, VPOP
      const words = g & 0xff & (double ? ~1 : ~0);
      this.cy += words;
      this.e(`b=(${this.r(n4)}${U ? '' : `-${imm}`})|0;`);
      for (let i = 0; i < words; i++) {
        if (L) this.e(`si[${first + i}]=core.ld32(b+${4 * i},${this.spent()});`);
        else this.e(`core.st32(b+${4 * i},si[${first + i}],${this.spent()});`);
      }
      if (W) this.set(n4, U ? `(b+${imm})|0` : 'b');
      return;
    }
    const n = (n4 << 1) | ((g >> 7) & 1);
    const m = ((g & 15) << 1) | ((g >> 5) & 1);
    if (g & 0x10 && !(h & 0x1000)) {
      const t = g >> 12;
      if ((h & 0xffe0) === 0xee00 && !double) {
        if (h & 0x10) this.set(t, `si[${n}]`);
        else this.e(`si[${n}]=${this.r(t)};`);
        return;
      }
      if (h === 0xeee1) return void this.e(`fpscr=${this.r(t)};`);
      if (h === 0xeef1) {
        if (t === 15) {
          this.e('x=fpscr;nz=x<0?-1:(x>>>30)&1?0:1;c=(x>>>29)&1;v=(x>>>28)&1;');
        } else this.set(t, 'fpscr');
        return;
      }
      if (h === 0xeef7 || h === 0xeef6) return this.set(t, h === 0xeef7 ? '0x10110021' : '0x11000011');
      if (double && (h & 0xff90) === 0xee00) {
        const at = ((g >> 7) & 1 ? 32 : 0) + n4 * 2 + ((h >> 5) & 1);
        return void this.e(`si[${at}]=${this.r(t)};`);
      }
      if (double && (h & 0xff90) === 0xee10) {
        const at = ((g >> 7) & 1 ? 32 : 0) + n4 * 2 + ((h >> 5) & 1);
        return this.set(t, `si[${at}]`);
      }
      return this.undefined(h, g);
    }
    if (double) return this.undefined(h, g);
    const op = ((h >> 7) & 1) * 8 + ((h >> 4) & 3) * 2 + ((g >> 6) & 1);
    if (h & 0x1000) {
      // VSEL, VMAXNM, VMINNM, VRINTA..M, VCVTA..M
      if ((h & 0xff80) === 0xfe00) {
        const cond = ['nz===0', 'v!==0', '(nz<0)===(v!==0)', 'nz!==0&&(nz<0)===(v!==0)'][(h >> 4) & 3];
        this.e(`si[${d}]=${cond}?si[${n}]:si[${m}];`);
      } else if ((h & 0xffb0) === 0xfe80) {
        this.e(`core.${g & 0x40 ? 'vminnm' : 'vmaxnm'}(${d},${n},${m});`);
      } else if ((h & 0xffbc) === 0xfeb8 && (g & 0xd0) === 0x40) {
        this.e(`core.vrint(${d},${m},${[1, 0, 2, 3][h & 3]});`);
      } else if ((h & 0xffbc) === 0xfebc) {
        this.e(`si[${d}]=core.toInt(${m},${[1, 0, 2, 3][h & 3]},${g & 0x80 ? 1 : 0});`);
      } else this.undefined(h, g);
      return;
    }
    if (OF_THREE[op]) {
      const [name, more] = OF_THREE[op];
      this.e(`core.${name}(${d},${n},${m});`);
      this.cy += more;
      return;
    }
    switch (op) {
      case 14: {
        // VMOV immediate
        const i8 = ((h & 15) << 4) | (g & 15);
        const bits = ((i8 & 0x80) << 24) | (i8 & 0x40 ? 0x3e000000 : 0x40000000) | ((i8 & 0x3f) << 19);
        this.e(`si[${d}]=${bits | 0};`);
        return;
      }
      case 15: {
        const kind = h & 15;
        const up = (g >> 7) & 1;
        switch (kind) {
          case 0: this.e(up ? `si[${d}]=si[${m}]&0x7fffffff;` : `si[${d}]=si[${m}];`); return;
          case 1: if (up) { this.e(`core.vsqrt(${d},${m});`); this.cy += 13; } else this.e(`si[${d}]=si[${m}]^-2147483648;`); return;
          case 2: case 3: this.e('core.halfConvert();'); return;
          case 4: this.e(`core.vcmp(${d},${m});`); return;
          case 5: this.e(`core.vcmp0(${d});`); return;
          case 6: this.e(`core.vrint(${d},${m},${up ? 4 : 5});`); return; // VRINTZ, VRINTR
          case 7: this.e(`core.vrint(${d},${m},5);`); return; // VRINTX
          case 8: this.e(`core.fromInt(${d},${m},${up});`); return;
          case 12: case 13: this.e(`si[${d}]=core.toInt(${m},${up ? 4 : 5},${kind & 1});`); return;
          case 10: case 11: case 14: case 15: {
            const wide = g & 0x80;
            const bits = (wide ? 32 : 16) - (((g & 15) << 1) | ((g >> 5) & 1));
            this.e(`core.fixed(${d},${kind},${wide ? 32 : 16},${bits});`);
            return;
          }
        }
      }
    }
    this.undefined(h, g);
  }
}
