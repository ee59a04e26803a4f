// The memory of a board, and its most used code as WebAssembly. core.mjs interprets code and counts where it branches
// to; what comes often is translated (translate.mjs), several blocks at a time. Translated code has the same cycles
// as the interpreter to the last one, cache misses of the flash included, and hands over to it whenever an interrupt or
// the end of the stretch may come before the end of a block.
//
// Code in flash is dropped when the flash is written. Blocks in RAM compare their instructions before they run.

import { AT, BIAS, ENDS, FLASH_BASE, FLASH_SIZE, LEFT } from './layout.mjs';
import { MEMORY_SIZE, PAGE, RAM_BASE, RAM_SIZE, WORD, XIP_LINES } from './layout.mjs';
import { CODE_TYPE, TYPES, moduleOf, translate } from './translate.mjs';
import { Code, moduleMaker } from './wasm.mjs';

const RETRY = 1000; // times as many branches to what could not be translated
const LONGEST = 0x7fff0000 - BIAS; // cycles that a stretch may have here

export class Native {
  /**
   * @param options.hot how many branches to a place let it be translated
   * @param options.batch how many translated regions make a module
   */
  constructor({ hot = 2000, batch = 32 } = {}) {
    this.hot = hot;
    this.batch = batch;
    this.memory = new WebAssembly.Memory({ initial: MEMORY_SIZE / PAGE });
    const { buffer } = this.memory;
    this.table = new WebAssembly.Table({ initial: 1024, element: 'anyfunc' });
    this.functions = 0;
    this.waiting = []; // translated code that is not in a module yet
    this.words = new Int32Array(buffer, 0, 64);
    this.registers = new Uint32Array(buffer, AT.registers, 16);
    this.xipCounts = new Uint32Array(buffer, AT.xipAccesses, 2);
    this.xipTags = new Int32Array(buffer, AT.xipTags, 2048);
    this.xipOld = new Uint8Array(buffer, AT.xipOld, 1024);
    this.xipPresent = new Uint8Array(buffer, AT.xipPresent, XIP_LINES);
    this.ram = new Uint8Array(buffer, AT.ram, RAM_SIZE);
    this.flash = new Uint8Array(buffer, AT.flash, FLASH_SIZE);
    this.ramEntries = new Int32Array(buffer, AT.ramEntries, RAM_SIZE / 2);
    this.flashEntries = new Int32Array(buffer, AT.flashEntries, FLASH_SIZE / 2);
    this.ram16 = new Uint16Array(buffer, AT.ram, RAM_SIZE / 2);
    this.flash16 = new Uint16Array(buffer, AT.flash, FLASH_SIZE / 2);
    this.ramSeen = new Uint8Array(buffer, AT.ramSeen, RAM_SIZE / 2);
    this.flashSeen = new Uint8Array(buffer, AT.flashSeen, FLASH_SIZE / 2);
    this.endWords = new Int32Array(buffer, AT.ends, 8 * ENDS);
    this.ends = 0; // used so far
    this.inFlash = []; // translated code there, see link()
    this.core = null;
    this.makeBase();
  }

  /** The RAM, the registers and the cache as after power-up, for a new chip. */
  clear() {
    this.registers.fill(0);
    this.xipCounts.fill(0);
    this.xipTags.fill(-1);
    this.xipOld.fill(0);
    this.xipPresent.fill(0);
    this.ram.fill(0);
  }

  /** Accesses other than to RAM and to flash go to the core. */
  get accesses() {
    const around = (access) => (offset, sofar, value) => {
      const { core, words } = this;
      const spent = sofar & 0xffff;
      const lines = sofar >>> 16;
      core.cyc = words[WORD.cycles] - BIAS + spent;
      core.xipCounts[0] += lines;
      const result = access(core, (RAM_BASE + offset) | 0, value);
      core.xipCounts[0] -= lines;
      words[WORD.cycles] = core.cyc + BIAS - spent;
      words[WORD.limit] = Math.min(core.limit, LONGEST) + BIAS;
      words[WORD.missCost] = core.missCost;
      return result;
    };
    return {
      load32: around((core, address) => core.load32(address)),
      load16: around((core, address) => core.load16(address)),
      load8: around((core, address) => core.load8(address)),
      store32: around((core, address, value) => core.store32(address, value)),
      store16: around((core, address, value) => core.store16(address, value)),
      store8: around((core, address, value) => core.store8(address, value)),
    };
  }

  /** The functions that all translated code uses, and `run`, which goes from one function to the next. */
  makeBase() {
    const { accesses } = this;
    const names = Object.keys(accesses);
    const imports = names.map((name) => [name, name.startsWith('load') ? 1 : 2]);
    const env = { memory: this.memory, table: this.table, ...accesses };
    const reads = [32, 16, 8];
    const exported = [['miss', 3], ...reads.map((bits) => [`read${bits}`, 1]), ['run', CODE_TYPE]];
    const binary = moduleMaker(TYPES, imports, exported, true)(
      [missCode(), 3],
      ...reads.map((bits, i) => [readCode(bits, i, names.length), 2]),
      [runCode(), 1]
    );
    const base = new WebAssembly.Instance(new WebAssembly.Module(binary), { env }).exports;
    this.run = base.run;
    this.env = {
      memory: this.memory,
      load32: base.read32,
      load16: base.read16,
      load8: base.read8,
      store32: accesses.store32,
      store16: accesses.store16,
      store8: accesses.store8,
      miss: base.miss,
    };
  }

  /** Whether there is translated code at an address. */
  has(pc) {
    const inRam = (pc - RAM_BASE) >>> 1;
    if (inRam < RAM_SIZE / 2) return this.ramEntries[inRam] > 0;
    const inFlash = (pc - FLASH_BASE) >>> 1;
    return inFlash < FLASH_SIZE / 2 && this.flashEntries[inFlash] > 0;
  }

  /** Before run(). */
  enter(core, cycles, nz, c, v, line) {
    const { words } = this;
    this.core = core;
    words[WORD.cycles] = cycles + BIAS;
    words[WORD.limit] = Math.min(core.limit, LONGEST) + BIAS;
    words[WORD.nz] = nz;
    words[WORD.c] = c;
    words[WORD.v] = v;
    words[WORD.line] = line;
    words[WORD.left] = LEFT.jump;
    words[WORD.missCost] = core.missCost;
  }

  /** After run() has returned this address. Returns whether its instruction has to be done even at the limit. */
  left(pc) {
    const why = this.words[WORD.left];
    if (why === LEFT.force) return true;
    if (why === LEFT.stale) this.forget(pc);
    else if (why === LEFT.jump && !this.has(pc)) this.count(pc);
    return false;
  }

  /** Count a branch to `pc`, where there is no translated code. */
  count(pc) {
    const [entries, index] = this.entryOf(pc);
    if (!(index >= 0 && index < entries.length)) return; // such as the boot ROM
    const counted = --entries[index];
    if (counted === -this.hot) this.translate(pc);
    else if (counted === -2 * this.hot) this.link(); // it waits for others for too long
    else if (counted < RETRY * -this.hot) entries[index] = 0; // it could not be, but the code may be another one now
  }

  entryOf(pc) {
    return pc >>> 24 === 0x20 ? [this.ramEntries, (pc - RAM_BASE) >> 1] : [this.flashEntries, (pc - FLASH_BASE) >> 1];
  }

  translate(pc) {
    const inRam = pc >>> 24 === 0x20;
    const region = inRam
      ? translate(this.ram16, this.ramSeen, RAM_BASE, pc, this.ends)
      : translate(this.flash16, this.flashSeen, FLASH_BASE, pc, this.ends);
    if (!region) return;
    if (this.ends + region.ends.length > ENDS) {
      this.drop();
      return;
    }
    for (const [cycles, lines, line, left, address] of region.ends) {
      this.endWords.set([cycles, lines, line, left, address], 8 * this.ends++);
    }
    this.waiting.push({ ...region, inRam });
    if (this.waiting.length >= this.batch) this.link();
  }

  /** Make a module of the regions that wait for it. */
  link() {
    const regions = this.waiting;
    if (!regions.length) return;
    this.waiting = [];
    const { exports } = new WebAssembly.Instance(new WebAssembly.Module(moduleOf(regions)), { env: this.env });
    for (const [i, { leaders, source, first, inRam }] of regions.entries()) {
      const number = ++this.functions;
      if (number >= this.table.length) this.table.grow(1024);
      this.table.set(number, exports[i]);
      const entries = inRam ? this.ramEntries : this.flashEntries;
      const places = [];
      for (const [j, address] of leaders.entries()) {
        const at = (address - (inRam ? RAM_BASE : FLASH_BASE)) >> 1;
        if (entries[at] > 0) continue;
        entries[at] = (number << 8) | j;
        places.push(at);
      }
      if (!inRam) this.inFlash.push({ source, first, number, places });
    }
  }

  /** Drop all translated code. */
  drop() {
    this.ramEntries.fill(0);
    this.flashEntries.fill(0);
    this.functions = this.ends = 0;
    this.waiting = [];
    this.inFlash = [];
  }

  /** The code at `pc` in RAM has changed. */
  forget(pc) {
    const [entries, index] = this.entryOf(pc);
    entries[index] = 0;
  }

  /** The cache has a line in its first or second half (1 or 2), in the place of another one (-1: of none). */
  replaced(old, line, half) {
    if (old >= 0) this.xipPresent[old] = 0;
    this.xipPresent[line] = half;
  }

  flushed() {
    this.xipPresent.fill(0);
  }

  /** After another state of the board has been put in its place. */
  restored() {
    this.xipPresent.fill(0);
    this.xipTags.forEach((line, i) => {
      if (line >= 0) this.xipPresent[line] = i < 1024 ? 1 : 2;
    });
    this.check();
  }

  /** The flash may have changed from one address in it to another one: drop what was translated from other code. */
  check(from = 0, to = FLASH_SIZE) {
    const { flash16, flashEntries } = this;
    const same = ({ source, first, inRam }) =>
      inRam || 2 * first >= to || 2 * (first + source.length) <= from || source.every((halfword, i) => halfword === flash16[first + i]);
    this.waiting = this.waiting.filter(same);
    const changed = this.inFlash.filter((region) => !same(region));
    if (!changed.length) return;
    this.inFlash = this.inFlash.filter((region) => !changed.includes(region));
    for (const { number, places } of changed) {
      for (const place of places) if (flashEntries[place] >> 8 === number) flashEntries[place] = 0;
    }
    for (let i = 0; i < flashEntries.length; i++) if (flashEntries[i] < 0) flashEntries[i] = 0;
  }
}

const increment = (code, address) => code.i32(0).word(address).i32(1).op('add').memory('store', address);

/** miss(line): replace a line of the cache. */
function missCode() {
  const code = new Code();
  const [line, set, tag, old] = [0, 1, 2, 3];
  increment(code, AT.xipAccesses);
  increment(code, AT.xipMisses);
  code.i32(0).word(AT.cycles).word(AT.missCost).op('add').memory('store', AT.cycles);
  code.get(line).i32(1023).op('and').set(set);
  // 1: the second half is replaced, and the other one comes next
  code.get(set).memory('load8', AT.xipOld).i32(1).op('eq').tee(old);
  code.i32(12).op('shl').get(set).i32(2).op('shl').op('add').tee(tag).memory('load', AT.xipTags).tee(set);
  code.i32(0).op('geS').if();
  code.get(set).i32(0).memory('store8', AT.xipPresent);
  code.end();
  code.get(tag).get(line).memory('store', AT.xipTags);
  code.get(old).i32(1).op('add').set(old);
  code.get(line).get(old).memory('store8', AT.xipPresent);
  code.get(line).i32(1023).op('and').get(old).memory('store8', AT.xipOld);
  return code;
}

/** read32(offset from RAM_BASE, sofar) and so on: anything but RAM. */
function readCode(bits, slow, miss) {
  const code = new Code();
  const [offset, sofar, line, found] = [0, 1, 2, 3];
  const address = () => code.get(offset).i32(RAM_BASE).op('add');
  address().i32(0xff000000 | (bits / 8 - 1)).op('and').i32(FLASH_BASE).op('eq').if();
  address().i32(0xffffff).op('and').i32(3).op('shrU').tee(line);
  code.memory('load8', AT.xipPresent).tee(found).if();
  increment(code, AT.xipAccesses);
  code.get(line).i32(1023).op('and').get(found).memory('store8', AT.xipOld);
  code.op('else').get(line).call(miss).end();
  address().i32(FLASH_SIZE - 1).op('and').memory(bits === 32 ? 'load' : `load${bits}`, AT.flash).op('return');
  code.end();
  return code.get(offset).get(sofar).call(slow);
}

/** run(pc): run translated code until the limit, or until something else is to be done; returns the address of that. */
function runCode() {
  const code = new Code();
  const [pc, entry] = [0, 1];
  code.block().loop();
  code.get(pc).i32(RAM_BASE).op('sub').i32(RAM_SIZE).op('ltU').if();
  code.get(pc).i32(RAM_BASE).op('sub').i32(1).op('shl').memory('load', AT.ramEntries).set(entry);
  code.op('else');
  code.get(pc).i32(FLASH_BASE).op('sub').i32(FLASH_SIZE).op('geU').brIf(1);
  code.get(pc).i32(FLASH_BASE).op('sub').i32(1).op('shl').memory('load', AT.flashEntries).set(entry);
  code.end();
  code.get(entry).i32(1).op('ltS').brIf(1);
  code.get(entry).i32(255).op('and').get(entry).i32(8).op('shrU').callIndirect(CODE_TYPE).i32(5).op('shl').set(entry);
  code.i32(0).i32(0).memory('i64Load', AT.cycles);
  code.get(entry).memory('i64Load', AT.ends).op('i64Add').memory('i64Store', AT.cycles);
  code.get(entry).memory('load', AT.ends + 8).i32(0).op('geS').if();
  code.i32(0).get(entry).memory('load', AT.ends + 8).memory('store', AT.line);
  code.end();
  code.get(entry).memory('load', AT.ends + 16).tee(pc).op('i32Eqz').if();
  code.word(AT.pc).set(pc);
  code.end();
  code.i32(0).get(entry).memory('load', AT.ends + 12).memory('store', AT.left);
  code.word(AT.left).brIf(1);
  code.word(AT.cycles).word(AT.limit).op('ltS').brIf(2);
  code.end().end();
  return code.get(pc);
}
