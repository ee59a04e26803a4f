// Thumb instructions of 16 bits, of which both processors' code consists, as text for assemble.mjs. What each does is written down here
// once, for functions of code and for what runs seldom: the M0+'s interpreter (m0.mjs), where all fields of an instruction are expressions, and
// the M33's steps (rp2350/emit.mjs), where numbers are.
//
// In the text: nz, c, v are the flags (N and Z from nz as a signed number); a, b, p, q, t, w, x are for what an instruction needs. A
// class that extends Thumb has `pc`, `next` (address after the instruction), `out` (text so far), and says how registers (`r`, `set`), memory (`loadTo`, `store`, `multiple`) and
// jumps (`jump`, `exitTo`, `bx`) are done, and what is not text: `call`, `breakpoint`, `hint`, `undefined`.

export const COND = [
  'nz===0', 'nz!==0', 'c!==0', 'c===0', 'nz<0', 'nz>=0', 'v!==0', 'v===0', 'c!==0&&nz!==0', '(c===0||nz===0)',
  '(nz<0)===(v!==0)', '(nz<0)!==(v!==0)', 'nz!==0&&(nz<0)===(v!==0)', '(nz===0||(nz<0)!==(v!==0))', 'true', 'true',
];
export const LONGEST = 48; // instructions of a piece

export const s32 = (x, bits) => (x << (32 - bits)) >> (32 - bits);

export class Thumb {
  /** @param fetch a function: address -> halfword; @param taken cycles of a jump on top of 1 */
  constructor(fetch, taken) {
    this.fetch = fetch;
    this.taken = taken;
  }

  e(text) {
    this.out.push(text);
  }
  get setsFlags() {
    return !this.inIT;
  }

  // ------------------------------------------------------------------ what an instruction contains

  field(h, at, bits, scale = 1) {
    return ((h >> at) & ((1 << bits) - 1)) * scale;
  }
  /** That of a shift. */
  amount(h) {
    return this.field(h, 6, 5);
  }
  /** The distance of a branch. */
  offset(h, bits) {
    return s32(h, bits) * 2;
  }
  /** Both registers of the instructions on all sixteen. */
  highRegisters(h) {
    return [(h >> 3) & 15, (h & 7) | ((h >> 4) & 8)];
  }
  /** Registers of PUSH and POP, as bits. */
  list(h, ninth) {
    return (h & 0xff) | (((h >> 8) & 1) << ninth);
  }
  /** An address from the program counter as this instruction reads it. */
  ahead(offset, aligned = false) {
    return (((this.pc + 4) & (aligned ? ~3 : ~0)) + offset) | 0;
  }
  /** A literal's address, as `load` and `loadTo` know it. */
  literalAt(h) {
    return `#${this.ahead(this.field(h, 0, 8, 4), true)}`;
  }
  /** What BLX puts into r14. */
  link14() {
    return `${this.next | 1}`;
  }
  /** The distance of BL, and of B.W without a condition. */
  longOffset(h, g) {
    const S = (h >> 10) & 1;
    const i1 = 1 ^ S ^ ((g >> 13) & 1);
    const i2 = 1 ^ S ^ ((g >> 11) & 1);
    return (S ? -0x1000000 : 0) + (i1 << 23) + (i2 << 22) + ((h & 0x3ff) << 12) + ((g & 0x7ff) << 1);
  }

  // ------------------------------------------------------------------ flags and shifts

  nz(text) {
    this.e(`nz=${text};`);
  }
  /** a+b, flags wanted; the result is in x. */
  addFlags(a, b) {
    this.e(`p=${a};q=${b};x=(p+q)|0;nz=x;c=(x>>>0)<(p>>>0)?1:0;v=((p^x)&(q^x))>>>31;`);
  }
  subFlags(a, b) {
    this.e(`p=${a};q=${b};x=(p-q)|0;nz=x;c=(p>>>0)>=(q>>>0)?1:0;v=((p^q)&(p^x))>>>31;`);
  }
  adcFlags(a, b) {
    this.e(`p=${a};q=${b};x=(p+q+c)|0;nz=x;c=((p&q)|((p|q)&~x))>>>31;v=((p^x)&(q^x))>>>31;`);
  }

  /** A shift by a constant: text of the result; sets c if `carry`. */
  shift(type, n, text, carry) {
    if (type === 3 && n === 0) {
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
    const C = (t) => (carry ? t : '');
    this.e(`q=${text};p=${by}&255;x=q;if(p){`);
    switch (type) {
      case 0: this.e(`if(p<32){${C('c=(q>>>(32-p))&1;')}x=q<<p;}else{${C('c=p===32?q&1:0;')}x=0;}`); break;
      case 1: this.e(`if(p<32){${C('c=(q>>>(p-1))&1;')}x=(q>>>p)|0;}else{${C('c=p===32?q>>>31:0;')}x=0;}`); break;
      case 2: this.e(`if(p<32){${C('c=(q>>>(p-1))&1;')}x=q>>p;}else{${C('c=q>>>31;')}x=q>>31;}`); break;
      default: this.e(`p=p&31;if(p)x=(q>>>p)|(q<<(32-p));${C('c=x>>>31;')}`);
    }
    this.e('}');
  }

  /** Write a register that may be the program counter. */
  write(d, text, extra = this.taken) {
    if (d === 15) this.exitTo(`(${text})&-2`, extra);
    else this.set(d, text);
  }
  /** Jump to the value of a register, as BLX. */
  blx(text) {
    this.bx(text);
  }

  // ------------------------------------------------------------------ instructions

  narrow(h) {
    const d = this.field(h, 0, 3);
    const n = this.field(h, 3, 3);
    const m = this.field(h, 6, 3);
    const d8 = this.field(h, 8, 3);
    const byte = this.field(h, 0, 8);
    const S = this.setsFlags;
    switch (h >> 11) {
      case 0: case 1: case 2: {
        const type = h >> 11;
        const amount = this.amount(h);
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
        if (S) this.nz(`${byte}`);
        this.set(d8, `${byte}`);
        return;
      case 5:
        this.subFlags(this.r(d8), `${byte}`);
        return;
      case 6: case 7: {
        const sub = h & 0x800;
        if (S) {
          if (sub) this.subFlags(this.r(d8), `${byte}`);
          else this.addFlags(this.r(d8), `${byte}`);
          this.set(d8, 'x');
        } else this.set(d8, `(${this.r(d8)}${sub ? '-' : '+'}${byte})|0`);
        return;
      }
      case 8:
        if (h & 0x400) this.special(h);
        else this.alu(h, d, n, S);
        return;
      case 9: this.loadTo(d8, 32, this.literalAt(h)); return;
      case 10: case 11: {
        const address = `${this.r(n)}+${this.r(m)}`;
        const op = (h >> 9) & 7;
        const size = [32, 16, 8, 8, 32, 16, 8, 16][op];
        if (op < 3) this.store(size, address, this.r(d));
        else this.loadTo(d, size, address, op === 3 || op === 7);
        return;
      }
      case 12: case 13: case 14: case 15: case 16: case 17: {
        const size = [32, 8, 16][((h >> 11) - 12) >> 1];
        const address = `${this.r(n)}+${this.field(h, 6, 5, size / 8)}`;
        if (h & 0x800) this.loadTo(d, size, address);
        else this.store(size, address, this.r(d));
        return;
      }
      case 18: this.store(32, `${this.r(13)}+${this.field(h, 0, 8, 4)}`, this.r(d8)); return;
      case 19: this.loadTo(d8, 32, `${this.r(13)}+${this.field(h, 0, 8, 4)}`); return;
      case 20: this.set(d8, `${this.ahead(this.field(h, 0, 8, 4), true)}`); return;
      case 21: this.set(d8, `(${this.r(13)}+${this.field(h, 0, 8, 4)})|0`); return;
      case 22: case 23: this.misc(h, d, n); return;
      case 24: this.multiple(d8, h & 255, false, true, false); return;
      case 25: this.multiple(d8, h & 255, true, !((h >> d8) & 1), false); return;
      case 26: case 27: {
        const cond = (h >> 8) & 15;
        if (cond === 14) this.undefined(h);
        else if (cond === 15) this.call('core.svc()');
        else this.branchIf(cond, this.ahead(this.offset(h, 8)));
        return;
      }
      case 28: this.jump(this.ahead(this.offset(h, 11))); return;
    }
    this.undefined(h);
  }

  branchIf(cond, target) {
    const ended = this.ended;
    const before = this.out.length;
    this.jump(target);
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
        if (S) { this.adcFlags(a, b); this.set(d, 'x'); } else this.set(d, `(${a}+${b}+c)|0`);
        return;
      case 6:
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
    const [m, d] = this.highRegisters(h);
    switch ((h >> 8) & 3) {
      case 0: this.write(d, `(${this.r(d)}+${this.r(m)})|0`); return;
      case 1: this.subFlags(this.r(d), this.r(m)); return;
      case 2: this.write(d, this.r(m)); return;
      default:
        if (h & 0x80) {
          this.e(`t=${this.r(m)};`);
          this.set(14, this.link14());
          this.blx('t');
        } else this.bx(this.r(m));
    }
  }

  misc(h, d, n) {
    switch ((h >> 8) & 15) {
      case 0: this.set(13, `(${this.r(13)}${h & 0x80 ? '-' : '+'}${this.field(h, 0, 7, 4)})|0`); return;
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
      case 4: case 5: this.multiple(13, this.list(h, 14), false, true, true); return;
      case 6: this.call(`core.cps(${this.field(h, 4, 1)},${this.field(h, 0, 2)})`); return;
      case 10: {
        const b = this.r(n);
        switch ((h >> 6) & 3) {
          case 0: this.e(`x=${b};`); this.set(d, '(x<<24)|((x&65280)<<8)|((x>>>8)&65280)|(x>>>24)'); return;
          case 1: this.e(`x=${b};`); this.set(d, '((x&0xff00ff)<<8)|((x>>>8)&0xff00ff)'); return;
          case 3: this.e(`x=${b};`); this.set(d, '((x<<24)|((x&65280)<<8))>>16'); return;
        }
        break;
      }
      case 12: case 13: this.multiple(13, this.list(h, 15), true, true, false); return;
      case 14: this.breakpoint(h); return;
      case 15: this.hint(h); return;
    }
    this.undefined(h);
  }
}
