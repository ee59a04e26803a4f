// The memory of a board with an RP2350, and its processor's code as WebAssembly: lists of steps (emit.mjs) of all code that has run, and functions
// in their place for those that have run often.

import { FLASH_BASE, PAGE, RAM_BASE } from '../layout.mjs';
import { Native } from '../native.mjs';
import { TEXTS, arithmetic } from './arithmetic.mjs';
import { Emitter, RAM_SIZE, SCRATCH, STATE } from './emit.mjs';

const FLASH_SIZE = 4 * 1024 * 1024;
const ROM_SIZE = 0x8000;
const AT = {
  registers: 0,
  state: 0x40,
  scratch: 0x80,
  floats: 0x100,
  xipTags: 0x1000,
  xipOld: 0x3000,
  ram: PAGE,
  ramEntries: 10 * PAGE,
  flash: 0x200000,
  flashEntries: 0x600000,
  lists: 0xe00000,
  xipPresent: 0x1500000,
};
const LISTS = 0x700000; // bytes
const MEMORY_SIZE = AT.xipPresent + FLASH_SIZE / 8;
const HELD = ['nz', 'c', 'v', ...Array.from({ length: 15 }, (_, n) => `r${n}`)];

const AHEAD = 800; // places that are looked at for steps
const LONGEST_PIECE = 256; // bytes

// An entry is a list: the most cycles of the piece, how often it has run, the function in its place or 0, and its steps. A step: its function, its
// address, cycles of the piece up to it with these bits, the number in it, its instruction.
const FIRST = 12; // bytes
export const STEP = 20;
const [USE, PLACE, IN_FLASH, FRESH, SECOND, WIDE, MOVES, LAST] = Array.from({ length: 8 }, (_, i) => 0x10000 << i);

/** Read the flash through its cache, or what is no RAM; k: cycles of the piece before the access. */
const read = (size) => [
  `ld${size}`,
  `if((a&${-0x1000000 | (size / 8 - 1)})===${FLASH_BASE}){
    a=a&${FLASH_SIZE - 1};w=a>>>3;x=present[w];
    if(x!==0)used[w&1023]=x;else core.miss(w);
    return flash${size}[a];
  }
  return core.slow${size}(a,k);`,
  ['a', 'k'],
];

/** Read a literal, in the flash past its cache. */
const literal = (size) => [
  `literal${size}`,
  `if((a&${-0x1000000 | (size === 32 ? 3 : 0)})===${FLASH_BASE})return flash${size}[a&${FLASH_SIZE - size / 8}];return core.ld${size}(a,k);`,
  ['a', 'k'],
];

const lineOf = (address) => `w=(${address}&${FLASH_SIZE - 1})>>>3;x=present[w];if(x===0)core.miss(w);else used[w&1023]=x;`;
const LEAVE = `if(f&${MOVES}){if(r13<floor)core.overflow();}`;

/** Run steps from one on. If the list is to end at the limit, the line is fetched before each of them: it may have left the cache. */
const STEPS = `
  A:for(;;){
    f=lists[i+8];
    here=lists[i+4];
    y=f&65535;
    t=f&${FRESH};
    if(stopping){if(f&${PLACE}){
      if(cycles+y>=limit){cycles+=y;stop=i;${LEAVE}return here;}
      t=f&${IN_FLASH};
    }}
    if(t){${lineOf('here')}}
    if(f&${SECOND}){${lineOf('(here+2)')}}
    cy=y+1+((f&${USE})>>>16);
    to=lists[i+12];
    x=core.run(lists[i+0]);
    if(x!==-1){${LEAVE}return x;}
    i=i+${STEP};
  }`;

/** An instruction, or half of one, in RAM or flash. */
const HALF = `o=a-${RAM_BASE};if(o>>>0<${RAM_SIZE})return m16[o];return flash16[a&${FLASH_SIZE - 1}];`;

/** Whether the code there is another one now than that of a list. */
const CHANGED = `
  i=list+${FIRST};
  A:for(;;){
    f=lists[i+8];
    y=lists[i+4];
    x=lists[i+16];
    if(core.half(y)!==(x&65535))return 1;
    if(f&${WIDE}){if(core.half(y+2)!==(x>>>16))return 1;}
    if(f&${LAST})return 0;
    i=i+${STEP};
  }`;

/** Run pieces that end before the limit, from r15 on. Returns 1 where the next one might not, and 0 after a return from an exception or a fault. */
const run = (hot) => `
  pc=r15;
  stopping=0;
  L:for(;;){
    o=pc-${FLASH_BASE};
    e=0;
    if(o>>>0<${FLASH_SIZE})e=inFlash[o>>>1];
    else{o=pc-${RAM_BASE};if(o>>>0<${RAM_SIZE})e=inRam[o>>>1];}
    if(e===0){
      r15=pc;
      e=core.find(pc);
      if(e===0)return 0;
    }
    if(cycles+lists[e+0]>limit){r15=pc;return 1;}
    t=lists[e+4]+1;
    lists[e+4]=t;
    if((t&${hot - 1})===0){core.often(pc);continue L;}
    r15=pc;
    t=lists[e+8];
    if(t!==0)pc=core.run(t);
    else{
      t=0;
      if(pc>>>28===2)t=core.changed(e);
      if(t!==0)pc=core.stale(pc);
      else pc=core.steps(e+${FIRST});
    }
  }`;

export class Native2350 extends Native {
  /**
   * @param options.hot how many runs of a list make a function of it, a power of two
   * @param options.batch how many functions make a module
   */
  constructor({ hot = 1024, batch = 32 } = {}) {
    super({ hot, batch });
  }

  get layout() {
    return { at: AT, ramSize: RAM_SIZE, flashSize: FLASH_SIZE, memorySize: MEMORY_SIZE, state: STATE, held: HELD };
  }

  makeBase() {
    const { buffer } = this.memory;
    this.floats = new Int32Array(buffer, AT.floats, 64);
    this.lists = new Int32Array(buffer, AT.lists, LISTS / 4);
    this.scratch = new Int32Array(buffer, AT.scratch, Object.keys(SCRATCH).length);
    for (const [name, n] of Object.entries(SCRATCH)) this.words[name] = AT.scratch + 4 * n;
    this.arrays.si = [AT.floats, 32];
    this.arrays.lists = [AT.lists, 32, true];
    const { registers } = this;
    this.offer(...arithmetic(this.state, this.floats));
    this.offer(
      {
        st32: (address, value, k) => this.core.st32(address, value, k),
        st16: (address, value, k) => this.core.st16(address, value, k),
        st8: (address, value, k) => this.core.st8(address, value, k),
        miss: (line) => this.core.xipLine(line),
        often: (pc) => this.often(pc),
        overflow: () => this.core.overflow(),
        halfConvert: () => this.core.halt('half-precision floats are not emulated'),
        mcrr: (cp, op, crm, low, high, k) => this.core.mcrr(cp, op, crm, low, high, k),
        mcr: (cp, op1, crn, crm, op2, value, k) => this.core.mcr(cp, op1, crn, crm, op2, value, k),
        cdp: (cp, op1, crn, crm, op2) => this.core.cdp(cp, op1, crn, crm, op2),
      },
      {
        slow32: (address, k) => this.core.ld32(address, k),
        slow16: (address, k) => this.core.ld16(address, k),
        slow8: (address, k) => this.core.ld8(address, k),
        find: (pc) => this.core.find(pc),
        mrs: (n) => this.core.mrs(n),
        tt: () => 0x00c00000 | (3 << 18), // secure, readable and writable
        mrrc: (cp, op, crm, other, k) => this.core.mrrc(cp, op, crm, other, k),
        mrc: (cp, op1, crn, crm, op2, other) => this.core.mrc(cp, op1, crn, crm, op2, other),
        // where the code goes on
        undefined: (pc, h, g) => this.core.undefined(pc, h, g),
        stale: (start) => (this.stale(start), start),
        bkpt: (number, pc) => (this.core.bkpt(number, pc), registers[15]),
        svc: () => (this.core.svc(), registers[15]),
        cps: (disable, which) => (this.core.cps(disable, which), registers[15]),
        wfe: () => (this.core.wfe(), registers[15]),
        wfi: () => (this.core.wfi(), registers[15]),
        sev: () => (this.core.sev(), registers[15]),
        msr: (n, value) => (this.core.msr(n, value), registers[15]),
      },
    );
    for (const text of TEXTS) this.offerText([text]);
    this.offerText([read(32), read(16), read(8), ['half', HALF, ['a']]]);
    this.offerText([literal(32), literal(16), literal(8)]);
    this.offerText([['changed', CHANGED, ['list']], ['steps', STEPS, ['i']]]);
    this.base = this.functions([['run', run(this.hot), []], ['steps', 'return core.steps(i);', ['i']], ['changed', 'return core.changed(list);', ['list']]]);
    this.run = this.base.run;
    this.steps = this.base.steps;
    const { flash } = this;
    this.emitter = new Emitter((pc) => this.halfword(pc), new DataView(flash.buffer, flash.byteOffset, flash.length));
  }

  attach(chip) {
    this.floats.fill(0);
    super.attach(chip);
  }

  /** Whether there can be code at an address. */
  canRun(pc) {
    return pc >>> 0 < ROM_SIZE || (pc - FLASH_BASE) >>> 0 < FLASH_SIZE || (pc - RAM_BASE) >>> 0 < RAM_SIZE;
  }

  entryOf(pc) {
    return pc >>> 0 < ROM_SIZE ? [this.romEntries, pc >> 1] : super.entryOf(pc);
  }

  /** The list of the piece at an address. */
  listOf(pc) {
    const [entries, index] = this.entryOf(pc);
    if (!entries[index]) entries[index] = this.makeList(pc);
    return entries[index];
  }

  makeList(pc) {
    const { steps, max } = this.emitter.steps(pc);
    if (this.listsEnd + FIRST + STEP * steps.length > LISTS) this.drop();
    const list = this.listsEnd;
    this.listsEnd += FIRST + STEP * steps.length;
    if (steps.some(({ what }) => !this.stepFunctions.has(what.text))) this.putSteps(pc);
    const moves = steps.some(({ what }) => what.movesStack) ? MOVES : 0;
    const inFlash = pc >>> 24 === 0x10 ? IN_FLASH : 0;
    const last = steps.findLast(({ h }) => h !== undefined);
    const words = [max, 0, 0];
    for (const step of steps) {
      const { pc, h, g, wide, what, cycles, use, place, fresh, second } = step;
      const bits = moves | inFlash | (use && USE) | (place && PLACE) | (fresh && FRESH) | (second && SECOND) | (wide && WIDE) | (step === last && LAST);
      words.push(this.stepFunctions.get(what.text), pc, cycles | bits, what.to, h | (g << 16));
    }
    this.lists.set(words, list >> 2);
    return list;
  }
  /** Make functions of the steps at `pc`, and of those to which they lead: a module costs much. */
  putSteps(pc) {
    const places = new Set([pc]);
    const texts = new Set();
    for (const place of places) {
      for (const { pc: at, what } of this.emitter.steps(place).steps) {
        if (!this.stepFunctions.has(what.text)) texts.add(what.text);
        for (const lead of what.leads) {
          if (places.size === AHEAD || this.seen.has(at + lead) || !this.canRun(at + lead)) continue;
          places.add(at + lead);
          this.seen.add(at + lead);
        }
      }
    }
    const first = this.putInTable([...texts], []);
    [...texts].forEach((text, i) => this.stepFunctions.set(text, first + i));
  }

  /** Where a step of a piece is. */
  stepOf(pc, number) {
    return this.listOf(pc) + FIRST + STEP * number;
  }
  /** The address of its instruction, and cycles of the piece up to it. */
  step(at) {
    return { pc: this.lists[(at >> 2) + 1], cycles: this.lists[(at >> 2) + 2] & 0xffff };
  }
  /** The address of the instruction in the piece at `pc` that begins before some cycles of it. */
  instructionAt(pc, cycles) {
    return this.emitter.steps(pc).steps.findLast((step) => step.cycles < cycles).pc;
  }
  hasChanged(pc) {
    return pc >>> 24 === 0x20 && this.base.changed(this.listOf(pc)) !== 0;
  }

  /** The piece there has run often: make a function of it and of others. */
  often(pc) {
    if (this.lists[(this.listOf(pc) >> 2) + 2]) return;
    if (!this.waiting.includes(pc)) {
      this.waiting.push(pc);
      if (this.waiting.length < this.batch) return;
    }
    const places = this.waiting.filter((place) => this.has(place) && !this.hasChanged(place));
    this.waiting = [];
    this.link(places);
  }
  placed(number, pc) {
    this.lists[(this.listOf(pc) >> 2) + 2] = number;
  }

  drop() {
    super.drop();
    this.romEntries = new Int32Array(ROM_SIZE / 2);
    this.stepFunctions = new Map(); // by their text
    this.seen = new Set(); // places
    this.listsEnd = STEP; // not 0
  }

  restored() {
    super.restored();
    this.dropChanged(this.ramEntries, 0, RAM_SIZE);
  }
  check(from = 0, to = FLASH_SIZE) {
    super.check(from, to);
    this.dropChanged(this.flashEntries, Math.max(0, from - LONGEST_PIECE), to);
  }
  dropChanged(entries, from, to) {
    for (let i = from >> 1; i < to >> 1; i++) if (entries[i] && this.base.changed(entries[i])) entries[i] = 0;
  }

  halfword(pc) {
    return pc >>> 0 < ROM_SIZE ? this.core.rom16[pc >> 1] : super.halfword(pc);
  }
}
