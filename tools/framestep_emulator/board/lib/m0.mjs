// The M0+'s code as text for assemble.mjs, with what thumb.mjs says of each instruction: pieces of code that is used much, and the interpreter
// for all other. Both take the same cycles to the last one, misses of the flash cache included.
//
// The cycles up to the last instruction of a block must fit into the limit: before it, and again after a miss or an access other than to
// RAM and flash. If they do not, the interpreter goes on, so that no instruction begins at the limit or later.

import { FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE } from './layout.mjs';
import { LONGEST, Thumb } from './thumb.mjs';

/** Words that the text knows by name: cycles and their limit, the flags as in Processor; the line of the flash that was fetched last, or -1; accesses of the
 * flash cache; a MODE, for after a piece; whether each instruction is noted for a profile. */
export const STATE = { cycles: 0, limit: 1, nz: 2, c: 3, v: 4, line: 5, accesses: 6, mode: 7, profiling: 8 };
/** How the interpreter goes on: at the beginning of a stretch; at the target of a jump, where there may be a piece, too; with the next instruction in
 * any case; with it even at the limit, since its fetch has begun. */
export const MODE = { start: -1, jump: 0, next: 1, force: 2 };

const REACH = 4 * LONGEST; // bytes, of branches to a block of the same piece
const LITERALS = 1024; // bytes after a piece that may be a part of it
const WINDOW = 0x1000000; // bytes of addresses through the flash cache, in which the flash repeats
const SETS = 1024; // of the cache
const lineOf = (address) => (address & 0xffffff) >>> 3;

/** A piece of code: from an address to a jump that is always taken and that no branch of the piece passes over. It consists of blocks: one begins at
 * the start, and one wherever a branch leads forward. */
export class Piece extends Thumb {
  constructor(fetch) {
    super(fetch, 1);
  }

  /** Text of the piece at `start`, and an address after it and its literals. */
  piece(start, forward = true) {
    this.start = start;
    this.forward = forward;
    this.inRam = start >>> 24 === 0x20;
    this.loops = false;
    this.targets = []; // of branches forward, in their order
    const text = [];
    const targets = [];
    const words = new Set(); // that have instructions
    const endBlock = () => text.push(this.out.join('').replaceAll('@BEFORE@', this.before));
    let pc = start;
    let end = start;
    this.beginBlock(pc);
    for (let count = 0; ; count++) {
      if (count >= LONGEST && !this.ended) this.exit(pc);
      if (this.ended) {
        if (!this.targets.length || count >= LONGEST) break;
        [pc] = this.targets;
      }
      if (pc > this.targets[0]) return this.piece(start, false); // a branch into the middle of an instruction
      if (pc === this.targets[0]) {
        if (!this.ended) this.e(this.account());
        endBlock();
        text.push('}');
        targets.push(this.targets.shift());
        this.beginBlock(pc);
      }
      this.pc = pc;
      this.before = this.cy;
      if (!this.inRam && pc >>> 3 !== this.line) {
        this.line = pc >>> 3;
        this.lines++;
        this.fetchLine();
      }
      const h = this.fetch(pc);
      const wide = h >>> 11 >= 0x1d;
      this.mark = this.out.length;
      this.next = (pc + (wide ? 4 : 2)) | 0;
      this.cy += 1;
      words.add(pc & ~3).add((this.next - 2) & ~3);
      if (wide) this.wide(h, this.fetch(pc + 2));
      else this.narrow(h);
      end = pc = this.next;
    }
    endBlock();
    for (const target of this.targets) text.push(`}return ${target};`);
    targets.push(...this.targets);
    const body = targets.map((target) => `B${target}:{`).reverse().join('') + text.join('');
    return { text: this.changed(words) + (this.loops ? `L:for(;;){${body}}` : body), last: end + LITERALS };
  }

  begin() {
    this.out = [];
    this.cy = 0;
    this.lines = 0; // of the flash that were fetched in this block, after its first one
    this.ended = false;
  }

  beginBlock(pc) {
    this.begin();
    this.pc = pc;
    this.line = this.inRam ? -1 : pc >>> 3;
    this.e(`if(cycles+@BEFORE@>=limit){mode=${MODE.next};return ${pc};}`);
    if (this.inRam) return;
    this.fetchLine();
    this.e(`if(line!==${this.line}){line=${this.line};accesses+=1;${this.out.pop()}}`);
  }

  /** Leave if the code in RAM is another one now. */
  changed(words) {
    if (!this.inRam) return '';
    const differences = [...words].map((at) => `m32[${at - RAM_BASE}]!==${this.word(at)}`);
    return `if(${differences.join('||')}){core.stale(${this.start});mode=${MODE.next};return ${this.start};}`;
  }

  word(at) {
    return this.fetch(at) | (this.fetch(at + 2) << 16);
  }

  account(extra = 0) {
    return `cycles+=${this.cy + extra};${this.lines ? `accesses+=${this.lines};line=${this.line};` : ''}`;
  }
  /** Leave before an instruction. */
  leave(pc, mode, cycles = this.cy) {
    return `return core.out(${pc},${cycles},${this.line},${(this.lines << 2) | mode});`;
  }
  /** Leave before the next instruction if the rest no longer fits into the limit. */
  again() {
    return `if(cycles+@BEFORE@>=limit)${this.leave(this.next, MODE.next)}`;
  }
  fetchLine() {
    this.cached(this.pc, this.leave(this.pc, MODE.force));
  }
  cached(at, leave) {
    const line = lineOf(at);
    this.e(`x=present[${line}];if(x!==0)used[${line % SETS}]=x;else{core.miss(${line});if(cycles+@BEFORE@>=limit)${leave}}`);
  }

  r(n) {
    return n === 15 ? `${(this.pc + 4) | 0}` : `r${n}`;
  }
  set(n, text) {
    this.e(`${this.r(n)}=${text};`);
  }
  exit(target, extra = 0) {
    this.e(`${this.account(extra)}return ${target};`);
    this.ended = true;
  }
  exitTo(text, extra = 0) {
    this.exit(text, extra);
  }
  jump(target, extra = this.taken) {
    if (target === this.start) {
      this.loops = true;
      this.e(`${this.account(extra)}continue L;`);
    } else if (this.forward && target > this.pc && target < this.start + REACH) {
      if (!this.targets.includes(target)) this.targets.push(target);
      this.targets.sort((one, other) => one - other);
      this.e(`${this.account(extra)}break B${target};`);
    } else return this.exit(target, extra);
    this.ended = true;
  }
  blx(text) {
    this.exitTo(`${text}&-2`, this.taken);
  }
  bx(text, extra = this.taken, thumb = 1) {
    this.e(`t=${text};${this.account(extra)}if(t>>>28===15||!(t&1))return core.bx(t,${this.next},${thumb});return t&-2;`);
    this.ended = true;
  }
  write(d, text) {
    if (d === 15) this.exitTo(`(${text})&-2`, this.taken);
    else this.set(d, d === 13 ? `(${text})&-4` : text);
  }
  /** What is rare is left to the interpreter. */
  call() {
    this.out.length = this.mark;
    this.cy = this.before;
    this.e(this.leave(this.pc, MODE.next));
    this.ended = true;
  }
  undefined() {
    this.call();
  }
  breakpoint() {
    this.call();
  }
  hint(h) {
    if ([0x20, 0x30, 0x40].includes(h & 0xff)) this.call();
  }

  loadTo(d, size, address, signed = false) {
    this.cy += 1;
    if (address.startsWith('#')) return this.literalTo(d, Number(address.slice(1)));
    const extend = signed ? `<<${32 - size}>>${32 - size}` : '';
    const to = this.r(d);
    this.e(`t=${address}-${RAM_BASE};${this.inside(size)}${to}=m${size}[t]${extend};`);
    this.e(`else{${to}=core.ld${size}(t+${RAM_BASE},${this.cy})${extend};${this.again()}}`);
  }
  literalTo(d, at) {
    if (this.inRam) return this.set(d, `m32[${at - RAM_BASE}]`);
    this.set(d, `${this.word(at)}`);
    this.cached(at, this.leave(this.next, MODE.next));
  }
  store(size, address, value) {
    this.cy += 1;
    this.e(`t=${address}-${RAM_BASE};${this.inside(size)}m${size}[t]=${value};`);
    this.e(`else{core.st${size}(t+${RAM_BASE},${value},${this.cy});${this.again()}}`);
  }
  /** If t is the place of an element in the RAM, or the first of some. */
  inside(size, elements = 1) {
    const shift = { 32: 2, 16: 1, 8: 0 }[size];
    return `if(${shift ? `(t>>>${shift}|t<<${32 - shift})` : 't'}>>>0<=${(RAM_SIZE >> shift) - elements})`;
  }

  multiple(n, list, load, writeback, before) {
    const numbers = Array.from({ length: 16 }, (_, k) => k).filter((k) => (list >> k) & 1);
    const count = numbers.length;
    const toPc = load && numbers.includes(15);
    if (!count) return this.call();
    const cycles = this.cy + 1;
    this.cy += count + (toPc ? 2 : 0);
    const move = (read, write) => numbers.map((k, i) => (load ? `${k === 15 ? 'b' : this.r(k)}=${read(i)};` : write(i, this.r(k)))).join('');
    const quick = move((i) => `m32[t+${4 * i}]`, (i, value) => `m32[t+${4 * i}]=${value};`);
    const at = (i) => `t+${RAM_BASE + 4 * i}`;
    const slow = move((i) => `core.ld32(${at(i)},${cycles + i})`, (i, value) => `core.st32(${at(i)},${value},${cycles + i});`);
    const after = writeback ? `${this.r(n)}=${at(before ? 0 : count)};` : '';
    this.e(`t=${this.r(n)}-${RAM_BASE + (before ? 4 * count : 0)};${this.inside(32, count)}{${quick}${after}}else{${slow}${after}${toPc ? '' : this.again()}}`);
    if (!toPc) return;
    this.e(`${this.account()}if(b>>>28===15)return core.bx(b,${this.next},0);return b&-2;`);
    this.ended = true;
  }

  misc(h, d, n) {
    if ([1, 3, 9, 11].includes((h >> 8) & 15)) this.undefined(h); // CBZ, CBNZ
    else super.misc(h, d, n);
  }

  wide(h, g) {
    if (h >>> 11 === 0x1e && (g & 0xd000) === 0xd000) {
      this.cy += 2;
      this.set(14, `${this.next | 1}`);
      this.exit((this.pc + 4 + this.longOffset(h, g)) | 0); // BL
    } else if (h === 0xf3bf) this.cy += 2; // DMB, DSB, ISB
    else this.call();
  }
}

// Registers of the instructions on all sixteen
const M = '(h>>>3&15)';
const D = '(h&7|h>>>4&8)';

/** The interpreter: what an instruction contains is read from it (h) when it is done. */
export class Interpreter extends Piece {
  field(h, at, bits, scale = 1) {
    const text = `h>>>${at}&${(1 << bits) - 1}`;
    return scale > 1 ? `((${text})<<${Math.log2(scale)})` : `(${text})`;
  }
  offset(h, bits) {
    return `(h<<${32 - bits}>>${31 - bits})`;
  }
  highRegisters() {
    return [M, D];
  }
  list(h, ninth) {
    this.ninth = h & 0x100 ? ninth : 0;
    return '';
  }
  ahead(offset, aligned = false) {
    return `((pc+4${aligned ? '&-4' : ''})+${offset})`;
  }
  literalTo(d) {
    this.set(d, `core.literal(${this.ahead(this.field(0, 0, 8, 4), true)},${this.cy})`);
  }
  link14() {
    return '(pc+2|1)';
  }
  r(n) {
    return n === M || n === D ? `(${n}===15?pc+4:r[${n}])` : `r[${n}]`;
  }
  set(n, text) {
    this.e(`r[${n}]=${text};`);
  }
  shift(type, amount, text, carry) {
    this.e(`w=${amount};${type ? 'if(!w)w=32;' : ''}`);
    this.shiftBy(type, text, 'w', carry);
    return 'x';
  }
  exit(target, extra = 0) {
    this.e(`pc=${target};cycles+=${this.cy + extra};continue J;`);
    this.ended = true;
  }
  jump(target, extra = this.taken) {
    this.exit(target, extra);
  }
  write(d, text) {
    this.e(`t=${text};if(${d}===15){pc=t&-2;cycles+=${this.cy + this.taken};continue J;}r[${d}]=${d}===13?t&-4:t;`);
  }
  bx(text, extra = this.taken, thumb = 1) {
    this.e(`t=${text};cycles+=${this.cy + extra};if(t>>>28===15||!(t&1))pc=core.bx(t,pc+2,${thumb});else pc=t&-2;continue J;`);
    this.ended = true;
  }
  call(text, size = 2, where = 'I') {
    this.e(`r[15]=pc+${size};cycles+=${this.cy};${text};pc=r[15];continue ${where};`);
    this.ended = true;
  }
  breakpoint() {
    this.call('core.bkpt(h&255,pc)', 2, 'J');
  }
  undefined() {
    this.call('core.undefined(h)');
  }
  hint() {
    this.call('core.hint(h&255)');
  }
  again() {
    return '';
  }

  multiple(n, list, load, writeback, before) {
    const { ninth } = this;
    this.ninth = 0;
    // b: the address, g: registers that are left, w: the next one
    this.e(`b=${this.r(n)};g=h&255;`);
    if (ninth) this.e('g=g|256;');
    if (before) this.e('w=g;A:for(;;){b=b-((w&1)<<2);w=w>>>1;if(!w)break A;}p=b;');
    this.e('w=0;A:for(;;){if(!g)break A;if(g&1){cycles+=1;');
    const number = ninth ? `(w===8?${ninth}:w)` : 'w'; // r15 is a place for the value here
    if (load) this.e(`r[${number}]=core.ld32(b,1);`);
    else this.e(`core.st32(b,r[${number}],1);`);
    this.e('b=b+4;}g=g>>>1;w=w+1;}');
    if (before) this.set(n, 'p');
    else if (n === 13 || !load) this.set(n, 'b');
    else this.e(`if(!(h>>>${n}&1))r[${n}]=b;`);
    if (!load || ninth !== 15) return;
    this.cy += 2;
    this.bx('r[15]', 0, 0);
  }

  wide() {
    this.e(
      'g=core.fetch(pc+2);if((g&53248)===53248){r[14]=pc+4|1;t=h<<21>>31;' + // BL
        'pc=pc+4+(t<<24|(1^t&1^(g>>>13&1))<<23|(1^t&1^(g>>>11&1))<<22|(h&1023)<<12|(g&2047)<<1);cycles+=3;continue J;}',
    );
    this.cy += 2;
    this.call('core.wide(h,g)', 4);
  }

  /** Text of a function of a MODE, which begins at r[15] and ends at the limit. `hot`: how many jumps to a place make a piece of it */
  text(hot) {
    const keys = new Map(); // the upper ten bits of the instructions that have a text
    for (let key = 0; key < 1024; key++) {
      const h = key << 6;
      this.begin();
      this.cy = 1;
      if (h >>> 11 === 0x1e) this.wide();
      else if (h >>> 11 > 0x1c) this.undefined();
      else this.narrow(h);
      if (!this.ended) this.e(`cycles+=${this.cy};break;`);
      const text = this.out.join('');
      keys.set(text, [...(keys.get(text) ?? []), key]);
    }
    const cases = [...keys].map(([text, those]) => those.map((key) => `case ${key}:`).join('') + text).join('');
    const look = (entries) => `{
      w=${entries}[o>>>1];
      if(w>0){pc=core.run(w);how=mode;mode=0;continue J;}
      if(how===${MODE.jump}){
        w=w-1;${entries}[o>>>1]=w;
        if(w===${-hot}||w===${-2 * hot})core.often(pc);
      }
    }`;
    return `
      pc=r[15];
      J:for(;;){
        if(how<=${MODE.jump}&&!profiling){
          o=pc-${FLASH_BASE};
          if(o>>>0<${FLASH_SIZE})${look('inFlash')}
          else{o=pc-${RAM_BASE};if(o>>>0<${RAM_SIZE})${look('inRam')}}
        }
        I:for(;;){
          if(cycles>=limit&&how!==${MODE.force}){r[15]=pc;return 0;}
          how=${MODE.jump};
          if(profiling)core.note(pc);
          o=pc-${FLASH_BASE};
          if(o>>>0<${WINDOW}){
            if(pc>>>3!==line){
              line=pc>>>3;accesses+=1;
              t=o>>>3;x=present[t];
              if(x!==0)used[t&${SETS - 1}]=x;else core.miss(t);
            }
            h=flash16[o&${FLASH_SIZE - 1}];
          }else{
            o=pc-${RAM_BASE};
            if(o>>>0<${RAM_SIZE})h=m16[o];
            else{h=core.slowFetch(pc);if(h<0){r[15]=pc;return 0;}}
          }
          switch(h>>>6){${cases}}
          pc=pc+2;
        }
      }`;
  }
}

/** Read the flash; `hit`: what else is done if it is in the cache. */
const readFlash = (size, hit) => `
  if((address&${-0x1000000 | (size / 8 - 1)})===${FLASH_BASE}){
    w=(address&16777215)>>>3;x=present[w];
    if(x!==0){${hit}used[w&${SETS - 1}]=x;}else core.miss(w);
    return flash${size}[address&${FLASH_SIZE - 1}];
  }
  return core.slow${size}(address,k);`;

/** Functions that code calls: name, text, parameters. k: cycles before the access that are not counted yet. */
export const HELPERS = [
  ...[32, 16, 8].map((size) => [`ld${size}`, readFlash(size, 'accesses+=1;'), ['address', 'k']]),
  ['literal', readFlash(32, ''), ['address', 'k']],
  [
    'fetch',
    `o=pc-${FLASH_BASE};if(o>>>0<${WINDOW})return flash16[o&${FLASH_SIZE - 1}];o=pc-${RAM_BASE};if(o>>>0<${RAM_SIZE})return m16[o];return core.slowFetch(pc);`,
    ['pc'],
  ],
  ['out', 'cycles+=spent;if(last!==-1)line=last;accesses+=more>>>2;mode=more&3;return pc;', ['pc', 'spent', 'last', 'more']],
];
