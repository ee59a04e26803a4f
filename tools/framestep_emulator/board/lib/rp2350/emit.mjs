// Armv8-M mainline (Cortex-M33) code as JavaScript. A piece of code, from an address to the next jump that is always
// taken, becomes the source text of one function: each instruction is decoded once and its meaning is written down in
// that text. So there is one description of every instruction, and no interpreter beside it.
//
// In the text: rN are the registers (local variables), nz, c, v the flags (N and Z from nz as a signed number), st[0] the
// cycles, st[1] their limit, st[9] the lowest stack pointer. The registers that a piece uses are read at its beginning and written back where it ends.
// IT blocks are resolved here: an instruction in one gets its condition, so the state of IT exists at no other time.

const COND = [
  'nz===0', 'nz!==0', 'c!==0', 'c===0', 'nz<0', 'nz>=0', 'v!==0', 'v===0', 'c!==0&&nz!==0', '(c===0||nz===0)',
  '(nz<0)===(v!==0)', '(nz<0)!==(v!==0)', 'nz!==0&&(nz<0)===(v!==0)', '(nz===0||(nz<0)!==(v!==0))', 'true', 'true',
];
const LONGEST = 48; // instructions of a piece

// Cycles: Arm publishes no table for the M33. These follow its pipeline; the README says how they compare with a real board.
const USE = 1; // on top of 1, of an instruction that reads what the one before it has loaded
const TAKEN = 2; // on top of 1
const DIVIDE = 7;

const s32 = (x, bits) => (x << (32 - bits)) >> (32 - bits);

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

export class Emitter {
  /** @param fetch a function: address -> halfword; options.line(address) -> text for a new line of the flash, or '' */
  constructor(fetch, { line = null, literal = null } = {}) {
    this.fetch = fetch;
    this.line = line;
    this.literal = literal;
  }

  /** Source text of the piece at `start`, its last address, and the most cycles that it takes. `stops`: text of a function of an index, which begins at that
   * instruction (`places` has the address and cycles of each) and ends before the first one that begins after the limit. */
  piece(start, stops = false) {
    this.used = 0;
    this.links = [];
    this.dirty = 0;
    this.flags = false;
    this.flagsDirty = false;
    this.out = [];
    this.cy = 0;
    this.start = stops ? null : start; // no loop inside
    this.loops = false;
    const places = [];
    this.ended = false;
    this.it = []; // conditions of the next instructions
    this.wasIT = this.fence = false;
    this.fp = false;
    let pc = start;
    let count = 0;
    let line = -1;
    let loaded = 0; // registers
    while (!this.ended) {
      if (count >= LONGEST && !this.it.length) {
        this.exit(pc);
        break;
      }
      if (stops && !this.it.length) {
        const place = places.push({ pc, cycles: this.cy }) - 1;
        line = -1; // it may have left the cache
        this.out.push(`case ${place}:`);
        if (place) this.out.push(`if(st[0]+${this.cy}>=st[1]){@WB@st[0]+=${this.cy};return core.stopped(self,${place});}`);
      }
      if (this.line && pc >>> 3 !== line) {
        line = pc >>> 3;
        this.out.push(this.line(pc));
      }
      const h = this.fetch(pc);
      const wide = h >>> 11 >= 0x1d;
      if (wide && this.line && (pc + 2) >>> 3 !== line) {
        line = (pc + 2) >>> 3;
        this.out.push(this.line(pc + 2));
      }
      this.pc = pc;
      this.next = pc + (wide ? 4 : 2);
      this.cond = this.it.length ? this.it.shift() : 14;
      this.inIT = this.cond !== 14 || this.wasIT;
      this.wasIT = this.it.length > 0;
      const before = this.out.length;
      const done = this.ended;
      const kept = [this.cy, this.ended, [...this.it], this.wasIT, this.fence];
      const instruction = (extra) => {
        this.reads = this.sets = 0;
        this.loads = false;
        this.cy += extra;
        if (wide) this.wide(h, this.fetch(pc + 2));
        else this.narrow(h);
      };
      instruction(1);
      if (this.reads & loaded) {
        this.out.length = before;
        [this.cy, this.ended, this.it, this.wasIT, this.fence] = kept;
        instruction(1 + USE);
      }
      loaded = this.loads ? this.sets : 0;
      if (this.cond < 14) {
        this.flags = true;
        const body = this.out.splice(before).join('');
        this.out.push(`if(${COND[this.cond]}){${body}}`);
        if (this.ended && !done) {
          this.ended = false; // only if the condition holds
          if (!this.it.length && this.fence) {
            this.exit(this.next);
            this.ended = true;
          }
        }
      }
      this.fence = false;
      count++;
      pc = this.next;
    }
    const regs = [];
    const back = [];
    for (let i = 0; i < 15; i++) {
      if ((this.used >> i) & 1) regs.push(`r${i}=r[${i}]`);
      if ((this.dirty >> i) & 1) back.push(`r[${i}]=r${i};`);
    }
    if ((this.dirty >> 13) & 1) back.push('if(r13<st[9])core.overflow();');
    if (this.flags || this.flagsDirty) regs.push('nz=st[2]', 'c=st[3]', 'v=st[4]');
    if (this.flagsDirty) back.push('st[2]=nz;st[3]=c;st[4]=v;');
    const max = this.cy + TAKEN;
    const text =
      (regs.length ? `let ${regs.join(',')};` : '') +
      (this.loops ? 'L:for(;;){' : stops ? 'switch(e){' : '') +
      this.out.join('\n').replaceAll('@WB@', back.join('')).replaceAll('@MAX@', max) +
      (this.loops || stops ? '}' : '');
    return { text, end: pc, links: this.links.length, max, places };
  }

  // ------------------------------------------------------------------ pieces of text

  link(target) {
    let i = this.links.indexOf(target | 0);
    if (i < 0) i = this.links.push(target | 0) - 1;
    return `(n${i}!==null?n${i}:(n${i}=core.find(${target | 0})))`;
  }
  r(n) {
    if (n === 15) return `${(this.pc + 4) | 0}`;
    this.used |= 1 << n;
    this.reads |= 1 << n;
    return `r${n}`;
  }
  set(n, text) {
    this.sets |= 1 << n;
    this.used |= 1 << n;
    this.dirty |= 1 << n;
    this.out.push(`r${n}=${text};`);
  }
  e(text) {
    this.out.push(text);
  }
  useFlags() {
    this.flags = this.flagsDirty = true;
  }
  get setsFlags() {
    return !this.inIT;
  }

  /** Leave for a known address. */
  exit(target, extra = 0) {
    this.e(`@WB@st[0]+=${this.cy + extra};return ${this.link(target)};`);
    this.ended = true;
  }
  exitTo(text, extra = 0) {
    this.e(`@WB@st[0]+=${this.cy + extra};return core.find(${text});`);
    this.ended = true;
  }
  /** Jump to a known address; a jump to the start of this piece stays in it. */
  jump(target, extra = TAKEN) {
    if (target === this.start) {
      this.loops = true;
      this.e(`st[0]+=${this.cy + extra};if(st[0]+@MAX@<=st[1])continue L;@WB@return self;`);
      this.ended = true;
    } else this.exit(target, extra);
  }
  undefined(h, h2) {
    const hex = h2 === undefined ? h.toString(16) : `${h.toString(16)} ${h2.toString(16)}`;
    this.e(`@WB@st[0]+=${this.cy};core.undefined(${this.pc | 0},'${hex}');return self;`);
    this.ended = true;
  }
  /** An operation of the core that may change anything. */
  call(text, next = this.next) {
    this.e(`@WB@st[0]+=${this.cy};${text};return core.find(${next | 0});`);
    this.ended = true;
    this.fence = true;
  }

  load(size, address, signed = false) {
    this.loads = true;
    if (address.startsWith('#')) {
      const at = Number(address.slice(1));
      const value = this.literal?.(at, size);
      if (value !== undefined && value !== null) return signed && size < 32 ? `${s32(value, size)}` : `${value}`;
      address = `${at | 0}`;
    }
    const f = { 32: 'ld32', 16: 'ld16', 8: 'ld8' }[size];
    this.e(`a=(${address})|0;o=(a-536870912)>>>0;`);
    const fast = { 32: 'ram32[o>>2]', 16: 'ram16[o>>1]', 8: 'ram8[o]' }[size];
    const aligned = { 32: '&&!(o&3)', 16: '&&!(o&1)', 8: '' }[size];
    const text = `(o<532480${aligned}?${fast}:core.${f}(a,${this.cy}))`;
    return signed ? `(${text}<<${32 - size}>>${32 - size})` : text;
  }
  store(size, address, value) {
    const f = { 32: 'st32', 16: 'st16', 8: 'st8' }[size];
    const fast = { 32: 'ram32[o>>2]', 16: 'ram16[o>>1]', 8: 'ram8[o]' }[size];
    const aligned = { 32: '&&!(o&3)', 16: '&&!(o&1)', 8: '' }[size];
    this.e(`a=(${address})|0;o=(a-536870912)>>>0;if(o<532480${aligned})${fast}=${value};else core.${f}(a,${value},${this.cy});`);
  }

  nz(text) {
    this.useFlags();
    this.e(`nz=${text};`);
  }
  /** a+b, flags wanted; the result is in x. */
  addFlags(a, b) {
    this.useFlags();
    this.e(`p=${a};q=${b};x=(p+q)|0;nz=x;c=(x>>>0)<(p>>>0)?1:0;v=((p^x)&(q^x))>>>31;`);
  }
  subFlags(a, b) {
    this.useFlags();
    this.e(`p=${a};q=${b};x=(p-q)|0;nz=x;c=(p>>>0)>=(q>>>0)?1:0;v=((p^q)&(p^x))>>>31;`);
  }
  adcFlags(a, b) {
    this.useFlags();
    this.e(`p=${a};q=${b};y=(p>>>0)+(q>>>0)+c;x=y|0;nz=x;c=y>4294967295?1:0;v=((p^x)&(q^x))>>>31;`);
  }

  /** A shift by a constant: text of the result; sets c if `carry`. */
  shift(type, n, text, carry) {
    if (carry) this.useFlags();
    if (type === 3 && n === 0) {
      this.flags = true;
      this.e(`q=${text};x=(c<<31)|(q>>>1);${carry ? 'c=q&1;' : ''}`);
      return 'x';
    }
    if (type === 0 && n === 0) return text;
    if (n === 0) n = 32;
    if (!carry) {
      switch (type) {
        case 0: return `(${text}<<${n})`;
        case 1: return n === 32 ? '0' : `(${text}>>>${n}|0)`;
        case 2: return `(${text}>>${Math.min(n, 31)})`;
        default: this.e(`q=${text};`); return `((q>>>${n})|(q<<${32 - n}))`;
      }
    }
    this.e(`q=${text};`);
    switch (type) {
      case 0: this.e(`x=q<<${n};c=(q>>>${32 - n})&1;`); break;
      case 1: this.e(n === 32 ? `x=0;c=q>>>31;` : `x=(q>>>${n})|0;c=(q>>>${n - 1})&1;`); break;
      case 2: this.e(n === 32 ? `x=q>>31;c=q>>>31;` : `x=q>>${n};c=(q>>>${n - 1})&1;`); break;
      default: this.e(`x=(q>>>${n})|(q<<${32 - n});c=(q>>>${n - 1})&1;`);
    }
    return 'x';
  }
  /** A shift by a register; the result is in x. */
  shiftBy(type, text, by, carry) {
    if (carry) this.useFlags();
    const C = (t) => (carry ? t : '');
    this.e(`q=${text};p=${by}&255;x=q;if(p){`);
    switch (type) {
      case 0: this.e(`if(p<32){${C('c=(q>>>(32-p))&1;')}x=q<<p;}else{${C('c=p===32?q&1:0;')}x=0;}`); break;
      case 1: this.e(`if(p<32){${C('c=(q>>>(p-1))&1;')}x=(q>>>p)|0;}else{${C('c=p===32?q>>>31:0;')}x=0;}`); break;
      case 2: this.e(`if(p<32){${C('c=(q>>>(p-1))&1;')}x=q>>p;}else{${C('c=q>>>31;')}x=q>>31;}`); break;
      default: this.e(`p&=31;if(p)x=(q>>>p)|(q<<(32-p));${C('c=x>>>31;')}`);
    }
    this.e('}');
  }

  /** Write a register that may be the program counter. */
  write(d, text, extra = TAKEN) {
    if (d === 15) this.exitTo(`(${text})&-2`, extra);
    else this.set(d, text);
  }
  /** The same with a value that tells the state (BX, POP, LDR). */
  bx(text, extra = TAKEN) {
    this.exitTo(`(${text})&-2`, extra);
  }

  // ------------------------------------------------------------------ 16 bits

  narrow(h) {
    const d = h & 7;
    const n = (h >> 3) & 7;
    const m = (h >> 6) & 7;
    const d8 = (h >> 8) & 7;
    const S = this.setsFlags;
    switch (h >> 11) {
      case 0: case 1: case 2: {
        const type = h >> 11;
        const amount = (h >> 6) & 31;
        if (type === 0 && amount === 0) {
          if (S) this.nz(this.r(n));
          this.set(d, this.r(n));
        } else {
          const x = this.shift(type, amount, this.r(n), S);
          if (S) this.nz(x);
          this.set(d, x);
        }
        return;
      }
      case 3: {
        const b = h & 0x400 ? `${m}` : this.r(m);
        const sub = h & 0x200;
        if (S) {
          if (sub) this.subFlags(this.r(n), b);
          else this.addFlags(this.r(n), b);
          this.set(d, 'x');
        } else this.set(d, `(${this.r(n)}${sub ? '-' : '+'}${b})|0`);
        return;
      }
      case 4:
        if (S) this.nz(`${h & 0xff}`);
        this.set(d8, `${h & 0xff}`);
        return;
      case 5:
        this.subFlags(this.r(d8), `${h & 0xff}`);
        return;
      case 6: case 7: {
        const sub = h & 0x800;
        if (S) {
          if (sub) this.subFlags(this.r(d8), `${h & 0xff}`);
          else this.addFlags(this.r(d8), `${h & 0xff}`);
          this.set(d8, 'x');
        } else this.set(d8, `(${this.r(d8)}${sub ? '-' : '+'}${h & 0xff})|0`);
        return;
      }
      case 8:
        if (h & 0x400) this.special(h);
        else this.alu(h, d, n, S);
        return;
      case 9: {
        const at = (((this.pc + 4) & ~3) + 4 * (h & 0xff)) | 0;
        this.set(d8, this.load(32, `#${at}`));
        return;
      }
      case 10: case 11: {
        const address = `${this.r(n)}+${this.r(m)}`;
        const op = (h >> 9) & 7;
        switch (op) {
          case 0: this.store(32, address, this.r(d)); return;
          case 1: this.store(16, address, this.r(d)); return;
          case 2: this.store(8, address, this.r(d)); return;
          case 3: this.set(d, this.load(8, address, true)); return;
          case 4: this.set(d, this.load(32, address)); return;
          case 5: this.set(d, this.load(16, address)); return;
          case 6: this.set(d, this.load(8, address)); return;
          default: this.set(d, this.load(16, address, true)); return;
        }
      }
      case 12: this.store(32, `${this.r(n)}+${((h >> 6) & 31) * 4}`, this.r(d)); return;
      case 13: this.set(d, this.load(32, `${this.r(n)}+${((h >> 6) & 31) * 4}`)); return;
      case 14: this.store(8, `${this.r(n)}+${(h >> 6) & 31}`, this.r(d)); return;
      case 15: this.set(d, this.load(8, `${this.r(n)}+${(h >> 6) & 31}`)); return;
      case 16: this.store(16, `${this.r(n)}+${((h >> 6) & 31) * 2}`, this.r(d)); return;
      case 17: this.set(d, this.load(16, `${this.r(n)}+${((h >> 6) & 31) * 2}`)); return;
      case 18: this.store(32, `${this.r(13)}+${(h & 0xff) * 4}`, this.r(d8)); return;
      case 19: this.set(d8, this.load(32, `${this.r(13)}+${(h & 0xff) * 4}`)); return;
      case 20: this.set(d8, `${(((this.pc + 4) & ~3) + 4 * (h & 0xff)) | 0}`); return;
      case 21: this.set(d8, `(${this.r(13)}+${4 * (h & 0xff)})|0`); return;
      case 22: case 23: this.misc(h, d, n); return;
      case 24: this.multiple(d8, h & 0xff, false, true, false); return;
      case 25: this.multiple(d8, h & 0xff, true, !((h >> d8) & 1), false); return;
      case 26: case 27: {
        const cond = (h >> 8) & 15;
        if (cond === 14) this.undefined(h);
        else if (cond === 15) this.call('core.svc()');
        else this.branchIf(cond, this.pc + 4 + s32(h & 0xff, 8) * 2);
        return;
      }
      case 28: this.jump((this.pc + 4 + s32(h & 0x7ff, 11) * 2) | 0); return;
    }
    this.undefined(h);
  }

  branchIf(cond, target) {
    this.flags = true;
    const ended = this.ended;
    const before = this.out.length;
    this.jump(target | 0);
    const body = this.out.splice(before).join('');
    this.e(`if(${COND[cond]}){${body}}`);
    this.ended = ended;
  }

  alu(h, d, m, S) {
    const b = this.r(m);
    const a = this.r(d);
    switch ((h >> 6) & 15) {
      case 0: this.set(d, `${a}&${b}`); if (S) this.nz(a); return;
      case 1: this.set(d, `${a}^${b}`); if (S) this.nz(a); return;
      case 2: case 3: case 4: case 7: {
        const type = { 2: 0, 3: 1, 4: 2, 7: 3 }[(h >> 6) & 15];
        this.shiftBy(type, a, b, S);
        if (S) this.nz('x');
        this.set(d, 'x');
        return;
      }
      case 5:
        this.flags = true;
        if (S) { this.adcFlags(a, b); this.set(d, 'x'); } else this.set(d, `(${a}+${b}+c)|0`);
        return;
      case 6:
        this.flags = true;
        if (S) { this.adcFlags(a, `~${b}`); this.set(d, 'x'); } else this.set(d, `(${a}+~${b}+c)|0`);
        return;
      case 8: this.nz(`${a}&${b}`); return;
      case 9: if (S) { this.subFlags('0', b); this.set(d, 'x'); } else this.set(d, `(-${b})|0`); return;
      case 10: this.subFlags(a, b); return;
      case 11: this.addFlags(a, b); return;
      case 12: this.set(d, `${a}|${b}`); if (S) this.nz(a); return;
      case 13: this.set(d, `Math.imul(${a},${b})`); if (S) this.nz(a); return;
      case 14: this.set(d, `${a}&~${b}`); if (S) this.nz(a); return;
      default: this.set(d, `~${b}`); if (S) this.nz(a);
    }
  }

  special(h) {
    const m = (h >> 3) & 15;
    const d = (h & 7) | ((h >> 4) & 8);
    switch ((h >> 8) & 3) {
      case 0: this.write(d, `(${this.r(d)}+${this.r(m)})|0`); return;
      case 1: this.subFlags(this.r(d), this.r(m)); return;
      case 2: this.write(d, this.r(m)); return;
      default:
        if (h & 0x80) {
          this.e(`t=${this.r(m)};`);
          this.set(14, `${this.next | 1}`);
          this.bx('t');
        } else this.bx(this.r(m));
    }
  }

  misc(h, d, n) {
    switch ((h >> 8) & 15) {
      case 0: this.set(13, `(${this.r(13)}${h & 0x80 ? '-' : '+'}${(h & 0x7f) * 4})|0`); return;
      case 1: case 3: case 9: case 11: {
        const target = this.pc + 4 + (((h >> 3) & 31) << 1) + (h & 0x200 ? 64 : 0);
        const before = this.out.length;
        const text = `${this.r(d)}${h & 0x800 ? '!==' : '==='}0`;
        this.jump(target | 0);
        const body = this.out.splice(before).join('');
        this.e(`if(${text}){${body}}`);
        this.ended = false;
        return;
      }
      case 2: {
        const b = this.r(n);
        this.set(d, [`${b}<<16>>16`, `${b}<<24>>24`, `${b}&65535`, `${b}&255`][(h >> 6) & 3]);
        return;
      }
      case 4: case 5: this.multiple(13, (h & 0xff) | (h & 0x100 ? 1 << 14 : 0), false, true, true); return;
      case 6: this.call(`core.cps(${(h >> 4) & 1},${h & 3})`); return;
      case 10: {
        const b = this.r(n);
        switch ((h >> 6) & 3) {
          case 0: this.e(`x=${b};`); this.set(d, '(x<<24)|((x&65280)<<8)|((x>>>8)&65280)|(x>>>24)'); return;
          case 1: this.e(`x=${b};`); this.set(d, '((x&0xff00ff)<<8)|((x>>>8)&0xff00ff)'); return;
          case 3: this.e(`x=${b};`); this.set(d, '((x<<24)|((x&65280)<<8))>>16'); return;
        }
        break;
      }
      case 12: case 13: this.multiple(13, (h & 0xff) | (h & 0x100 ? 1 << 15 : 0), true, true, false); return;
      case 14: this.call(`core.bkpt(${h & 0xff},${this.pc | 0},${this.next | 0});return core.find(r[15])`); return;
      case 15: {
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
        this.wasIT = true;
        return;
      }
    }
    this.undefined(h);
  }

  /** LDM, STM, PUSH, POP. before: the first address is below the base. */
  multiple(n, list, load, writeback, before) {
    let count = 0;
    for (let i = list; i; i &= i - 1) count++;
    this.cy += count;
    const base = this.r(n);
    this.e(`b=(${base}${before ? `-${4 * count}` : ''})|0;o=(b-536870912)>>>0;`);
    const after = before ? 'b' : `(b+${4 * count})|0`;
    let fast = 'o>>=2;';
    let slow = '';
    let i = 0;
    for (let k = 0; k < 16; k++) {
      if (!((list >> k) & 1)) continue;
      if (load) {
        const to = k === 15 ? 't' : `r${k}`;
        if (k < 15) {
          this.used |= 1 << k;
          this.dirty |= 1 << k;
          this.sets = 1 << k;
          this.loads = true;
        }
        fast += `${to}=ram32[o+${i}];`;
        slow += `${to}=core.ld32((b+${4 * i})|0,${this.cy});`;
      } else {
        fast += `ram32[o+${i}]=${this.r(k)};`;
        slow += `core.st32((b+${4 * i})|0,${this.r(k)},${this.cy});`;
      }
      i++;
    }
    if (writeback && !(load && (list >> n) & 1)) {
      this.dirty |= 1 << n;
      const wb = `r${n}=${after};`;
      fast += wb;
      slow += wb;
    }
    this.e(`if(o<=${532480 - 4 * count}&&!(o&3)){${fast}}else{${slow}}`);
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
      const base = literal ? `${(this.pc + 4) & ~3}` : this.r(n);
      this.cy += 1;
      this.e(`b=(${base}${P ? `+${offset}` : ''})|0;`);
      if (L) {
        this.e(`t=${this.load(32, 'b')};`);
        const second = this.load(32, 'b+4');
        this.set(t2, second);
        this.set(t, 't');
      } else {
        this.store(32, 'b', this.r(t));
        this.store(32, 'b+4', this.r(t2));
      }
      if (W) this.set(n, P ? 'b' : `(b+${offset})|0`);
      return;
    }
    if (!(h & 0x80)) {
      if (h & 0x10) {
        // LDREX
        this.set(t, this.load(32, `${this.r(n)}+${4 * (g & 0xff)}`));
        this.e('st[6]=1;');
      } else if (g >> 12 === 15 && n !== 15 && (h & 0xfff0) === 0xe840 && (g & 0x3f) === 0) {
        // TT, TTT, TTA, TTAT: everything is secure and accessible
        this.set(t2, 'core.tt()');
      } else {
        // STREX
        this.e('if(st[6]){st[6]=0;');
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
      const base = n === 15 ? `${(this.pc + 4) | 0}` : this.r(n);
      const m = g & 15;
      this.cy += USE;
      const text = kind ? this.load(16, `${base}+(${this.r(m)}<<1)`) : this.load(8, `${base}+${this.r(m)}`);
      this.exitTo(`(${(this.pc + 4) | 0}+(${text}<<1))|0`, TAKEN);
      return;
    }
    const size = [8, 16, 32, 0][kind & 3];
    if (size && kind >= 4) {
      this.cy += 1;
      const exclusive = kind < 8 || kind >= 12;
      if (L) {
        this.set(t, this.load(size, this.r(n)));
        if (exclusive) this.e('st[6]=1;');
      } else if (!exclusive) this.store(size, this.r(n), this.r(t));
      else {
        this.e('if(st[6]){st[6]=0;');
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
        this.flags = true;
        if (S) { this.adcFlags(a(), b); this.set(d, 'x'); } else this.set(d, `(${a()}+${b}+c)|0`);
        return;
      case 11:
        this.flags = true;
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
      this.useFlags();
      this.e(`c=${carry};`);
    }
    this.process(op, S, n, d, value < 0 ? `(${value})` : `${value}`, h, g);
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
      case 0: this.set(d, n === 15 ? `${(((this.pc + 4) & ~3) + i12) | 0}` : `(${this.r(n)}+${i12})|0`); return;
      case 10: this.set(d, n === 15 ? `${(((this.pc + 4) & ~3) - i12) | 0}` : `(${this.r(n)}-${i12})|0`); return;
      case 4: this.set(d, `${i16}`); return;
      case 12: this.set(d, `(${this.r(d)}&65535)|${(i16 << 16) | 0}`); return;
      case 16: case 18: {
        if (op === 18 && lsb === 0) {
          this.set(d, `core.both(${this.r(n)},core.ssat,${(low & 15) + 1})`); // SSAT16
          return;
        }
        const x = this.shift(op === 18 ? 2 : 0, lsb, this.r(n), false);
        this.set(d, `core.ssat(${x},${low + 1})`);
        return;
      }
      case 24: case 26: {
        if (op === 26 && lsb === 0) {
          this.set(d, `core.both(${this.r(n)},core.usat,${low & 15})`); // USAT16
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
    const S = (h >> 10) & 1;
    const j1 = (g >> 13) & 1;
    const j2 = (g >> 11) & 1;
    if (g & 0x1000) {
      const i1 = 1 ^ S ^ j1;
      const i2 = 1 ^ S ^ j2;
      const offset = (S ? -0x1000000 : 0) + (i1 << 23) + (i2 << 22) + ((h & 0x3ff) << 12) + ((g & 0x7ff) << 1);
      const target = (this.pc + 4 + offset) | 0;
      if (g & 0x4000) this.set(14, `${this.next | 1}`); // BL
      this.jump(target);
      return;
    }
    if ((h & 0x380) !== 0x380) {
      const offset = (S ? -0x100000 : 0) + (j2 << 19) + (j1 << 18) + ((h & 0x3f) << 12) + ((g & 0x7ff) << 1);
      this.branchIf((h >> 6) & 15, this.pc + 4 + offset);
      return;
    }
    if ((h & 0xffe0) === 0xf380) {
      this.call(`core.msr(${g & 0xff},${this.r(h & 15)},${(g >> 10) & 3})`);
      return;
    }
    if (h === 0xf3ef) {
      this.flags = true;
      this.e('@WB@');
      this.set((g >> 8) & 15, `core.mrs(${g & 0xff})`);
      // the values written back are not read again: the register files are the same
      return;
    }
    if (h === 0xf3bf) {
      const op = (g >> 4) & 15;
      if (op === 2) this.e('st[6]=0;'); // CLREX
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
      const at = (((this.pc + 4) & ~3) + (h & 0x80 ? 1 : -1) * (g & 0xfff)) | 0;
      address = `#${at}`;
    } else if (h & 0x80) address = `${this.r(n)}+${g & 0xfff}`;
    else if (!(g & 0x800)) address = `${this.r(n)}+(${this.r(g & 15)}<<${(g >> 4) & 3})`;
    else {
      const offset = (g & 0x200 ? 1 : -1) * (g & 0xff);
      const P = g & 0x400;
      const W = g & 0x100;
      if (W || !P) {
        this.e(`b=(${this.r(n)}+${offset})|0;`);
        address = P ? 'b' : this.r(n);
        after = 'b';
      } else address = `${this.r(n)}+${offset}`;
      if (P && g & 0x200 && !W) address = `${this.r(n)}+${g & 0xff}`; // LDRT and so on, as privileged
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
      this.flags = true;
      this.e('@WB@');
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
    const plus = a === 15 ? '' : `${this.r(a)}+`;
    const half = (text, top) => (top ? `(${text}>>16)` : `(${text}<<16>>16)`);
    switch (op) {
      case 0:
        if (op2 === 0) this.set(d, a === 15 ? `Math.imul(${N},${M})` : `(${this.r(a)}+Math.imul(${N},${M}))|0`);
        else this.set(d, `(${this.r(a)}-Math.imul(${N},${M}))|0`);
        return;
      case 1:
        this.e(`y=${plus}Math.imul(${half(N, op2 & 2)},${half(M, op2 & 1)});if(y!==(y|0))st[5]=1;`);
        this.set(d, 'y|0');
        return;
      case 2: case 4: {
        this.e(`q=${M};${op2 & 1 ? 'q=(q>>>16)|(q<<16);' : ''}p=${N};`);
        this.e(`y=${plus}Math.imul(p<<16>>16,q<<16>>16)${op === 4 ? '-' : '+'}Math.imul(p>>16,q>>16);if(y!==(y|0))st[5]=1;`);
        this.set(d, 'y|0');
        return;
      }
      case 3:
        this.e(`y=${plus}core.mulWide(${N},${half(M, op2 & 1)});if(y!==(y|0))st[5]=1;`);
        this.set(d, 'y|0');
        return;
      case 5: this.set(d, `core.mulTop(${N},${M},${a === 15 ? 0 : this.r(a)},${op2 & 1},false)`); return;
      case 6: this.set(d, `core.mulTop(${N},${M},${this.r(a)},${op2 & 1},true)`); return;
      case 7: this.set(d, `core.usad(${N},${M},${a === 15 ? 0 : this.r(a)})`); return;
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
      this.e(`p=${N};q=${M};`);
      this.set(high, 'q===0?0:(p/q)|0');
      return;
    }
    if (op === 3 && op2 === 15) {
      this.cy += DIVIDE - 1;
      this.e(`p=${N};q=${M};`);
      this.set(high, 'q===0?0:((p>>>0)/(q>>>0))|0');
      return;
    }
    const long = { 0: 'smull', 2: 'umull', 4: 'smlal', 6: 'umlal' }[op];
    if (long && (op2 === 0 || (op === 6 && op2 === 6))) {
      this.cy += 1;
      const name = op2 === 6 ? 'umaal' : long;
      const rest = name.endsWith('ull') ? '' : `,${this.r(low)},${this.r(high)}`;
      this.e(`p=core.${name}(${N},${M}${rest});`);
      this.set(low, 'p');
      this.set(high, 'st[7]');
      return;
    }
    const halves = op === 4 && op2 >> 2 === 2; // SMLALBB and the like
    if (halves || ((op === 4 || op === 5) && op2 >> 1 === 6)) {
      const half = (text, top) => (top ? `(${text}>>16)` : `(${text}<<16>>16)`);
      this.e(`q=${M};p=${N};`);
      if (halves) this.e(`x=Math.imul(${half('p', op2 & 2)},${half('q', op2 & 1)});`);
      else {
        // SMLALD, SMLSLD
        if (op2 & 1) this.e('q=(q>>>16)|(q<<16);');
        this.e(`x=Math.imul(p<<16>>16,q<<16>>16)${op === 5 ? '-' : '+'}Math.imul(p>>16,q>>16);`);
      }
      this.e(`p=core.accumulate(x,${this.r(low)},${this.r(high)});`);
      this.set(low, 'p');
      this.set(high, 'st[7]');
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
        this.e(`p=core.mrrc(${cp},${op},${g & 15},${(h >> 12) & 1},${this.cy});`);
        this.set(t, 'p');
        this.set(t2, 'st[7]');
      } else this.e(`core.mcrr(${cp},${op},${g & 15},${this.r(t)},${this.r(t2)},${this.cy});`);
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
          this.useFlags();
          this.e('nz=x<0?-1:(x>>>30)&1?0:1;c=(x>>>29)&1;v=(x>>>28)&1;');
        } else this.set(t, 'x');
      } else this.e(`core.mcr(${cp},${op1},${args},${this.r(t)},${this.cy});`);
      return;
    }
    this.undefined(h, g);
  }

  float(h, g, double) {
    if (!this.fp || this.cond < 14) {
      this.e('st[8]=4;'); // CONTROL.FPCA
      this.fp = this.cond >= 14;
    }
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
        const base = n4 === 15 ? `${(this.pc + 4) & ~3}` : this.r(n4);
        for (let i = 0; i < (double ? 2 : 1); i++) {
          const address = `${base}${U ? '+' : '-'}${imm}${i ? '+4' : ''}`;
          if (L) {
            const text = this.load(32, n4 === 15 ? `#${((this.pc + 4) & ~3) + (U ? imm : -imm) + 4 * i}` : address);
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
        if (L) this.e(`si[${first + i}]=core.ld32((b+${4 * i})|0,${this.cy});`);
        else this.e(`core.st32((b+${4 * i})|0,si[${first + i}],${this.cy});`);
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
      if (h === 0xeee1) return void this.e(`core.fpscr=${this.r(t)};`);
      if (h === 0xeef1) {
        if (t === 15) {
          this.useFlags();
          this.e('x=core.fpscr;nz=x<0?-1:(x>>>30)&1?0:1;c=(x>>>29)&1;v=(x>>>28)&1;');
        } else this.set(t, 'core.fpscr');
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
        this.flags = true;
        this.e(`si[${d}]=${cond}?si[${n}]:si[${m}];`);
      } else if ((h & 0xffb0) === 0xfe80) {
        this.e(`s[${d}]=core.${g & 0x40 ? 'minnm' : 'maxnm'}(s[${n}],s[${m}]);`);
      } else if ((h & 0xffbc) === 0xfeb8 && (g & 0xd0) === 0x40) {
        this.e(`s[${d}]=core.rint(s[${m}],${['1', '0', '2', '3'][h & 3]});`);
      } else if ((h & 0xffbc) === 0xfebc) {
        this.e(`si[${d}]=core.toInt(core.rint(s[${m}],${['1', '0', '2', '3'][h & 3]}),${g & 0x80 ? 1 : 0});`);
      } else this.undefined(h, g);
      return;
    }
    switch (op) {
      case 0: this.e(`s[${d}]=s[${d}]+Math.fround(s[${n}]*s[${m}]);`); this.cy += 2; return; // VMLA
      case 1: this.e(`s[${d}]=s[${d}]-Math.fround(s[${n}]*s[${m}]);`); this.cy += 2; return;
      case 2: this.e(`s[${d}]=-s[${d}]+Math.fround(s[${n}]*s[${m}]);`); this.cy += 2; return; // VNMLS
      case 3: this.e(`s[${d}]=-s[${d}]-Math.fround(s[${n}]*s[${m}]);`); this.cy += 2; return; // VNMLA
      case 4: this.e(`s[${d}]=s[${n}]*s[${m}];`); return;
      case 5: this.e(`s[${d}]=-s[${n}]*s[${m}];`); return;
      case 6: this.e(`s[${d}]=s[${n}]+s[${m}];`); return;
      case 7: this.e(`s[${d}]=s[${n}]-s[${m}];`); return;
      case 8: this.e(`s[${d}]=s[${n}]/s[${m}];`); this.cy += 13; return;
      case 10: this.e(`s[${d}]=core.fma(s[${n}],s[${m}],-s[${d}]);`); this.cy += 2; return; // VFNMS
      case 11: this.e(`s[${d}]=core.fma(-s[${n}],s[${m}],-s[${d}]);`); this.cy += 2; return; // VFNMA
      case 12: this.e(`s[${d}]=core.fma(s[${n}],s[${m}],s[${d}]);`); this.cy += 2; return; // VFMA
      case 13: this.e(`s[${d}]=core.fma(-s[${n}],s[${m}],s[${d}]);`); this.cy += 2; return; // VFMS
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
          case 1: if (up) { this.e(`s[${d}]=Math.sqrt(s[${m}]);`); this.cy += 13; } else this.e(`si[${d}]=si[${m}]^-2147483648;`); return;
          case 2: case 3: this.e(`core.halfConvert(${kind},${up},${d},${m});`); return;
          case 4: this.e(`core.compare(s[${d}],s[${m}]);`); return;
          case 5: this.e(`core.compare(s[${d}],0);`); return;
          case 6: this.e(`s[${d}]=core.rint(s[${m}],${up ? 4 : 5});`); return; // VRINTZ, VRINTR
          case 7: this.e(`s[${d}]=core.rint(s[${m}],5);`); return; // VRINTX
          case 8: this.e(up ? `s[${d}]=si[${m}];` : `s[${d}]=si[${m}]>>>0;`); return;
          case 12: this.e(`si[${d}]=core.toInt(${up ? '' : 'core.rint('}s[${m}]${up ? '' : ',5)'},0);`); return;
          case 13: this.e(`si[${d}]=core.toInt(${up ? '' : 'core.rint('}s[${m}]${up ? '' : ',5)'},1);`); return;
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
