// The memory of a board and the code of its processor as WebAssembly. Of an RP2040: an interpreter, which counts where code branches to, and
// pieces of the code that is used much (m0.mjs). Of an RP2350: pieces of all code (rp2350/native.mjs).
//
// Pieces of code in flash are dropped when the flash is written. Those in RAM compare their instructions before they run.

import { INDIRECT, assemble } from './assemble.mjs';
import { AT, FLASH_BASE, FLASH_SIZE, MEMORY_SIZE, PAGE, RAM_BASE, RAM_SIZE } from './layout.mjs';
import { HELPERS, Interpreter, Piece, STATE } from './m0.mjs';
import { moduleMaker } from './wasm.mjs';

const PIECE = [0, 1]; // parameters and results
const MOST = 20_000; // pieces, before all of them are dropped
const HELD = ['nz', 'c', 'v', 'r0', 'r1', 'r2', 'r3', 'r4', 'r5', 'r6', 'r7']; // in locals, in a piece

export class Native {
  get layout() {
    return { at: AT, ramSize: RAM_SIZE, flashSize: FLASH_SIZE, memorySize: MEMORY_SIZE, state: STATE, held: HELD };
  }

  /**
   * @param options.hot how many branches to a place make a piece of it
   * @param options.batch how many pieces make a module
   */
  constructor({ hot = 3000, batch = 32 } = {}) {
    this.hot = hot;
    this.batch = batch;
    const { at, ramSize, flashSize, memorySize, state } = this.layout;
    this.memory = new WebAssembly.Memory({ initial: memorySize / PAGE });
    const { buffer } = this.memory;
    this.registers = new Int32Array(buffer, at.registers, 16);
    this.state = new Int32Array(buffer, at.state, Object.keys(state).length);
    this.xipTags = new Int32Array(buffer, at.xipTags, 2048);
    this.xipOld = new Uint8Array(buffer, at.xipOld, 1024);
    this.xipPresent = new Uint8Array(buffer, at.xipPresent, memorySize - at.xipPresent);
    this.ram = new Uint8Array(buffer, at.ram, ramSize);
    this.flash = new Uint8Array(buffer, at.flash, flashSize);
    this.ram16 = new Uint16Array(buffer, at.ram, ramSize / 2);
    this.flash16 = new Uint16Array(buffer, at.flash, flashSize / 2);
    this.ramEntries = new Int32Array(buffer, at.ramEntries, ramSize / 2);
    this.flashEntries = new Int32Array(buffer, at.flashEntries, flashSize / 2);
    this.table = new WebAssembly.Table({ initial: 1024, element: 'anyfunc' });
    this.words = {};
    for (let n = 0; n < 16; n++) this.words[`r${n}`] = at.registers + 4 * n;
    for (const [name, n] of Object.entries(state)) this.words[name] = at.state + 4 * n;
    this.arrays = {
      r: [at.registers, 32],
      present: [at.xipPresent, 8],
      used: [at.xipOld, 8],
      inFlash: [at.flashEntries, 32],
      inRam: [at.ramEntries, 32],
      m32: [at.ram, 32, true],
      m16: [at.ram, 16, true],
      m8: [at.ram, 8, true],
      flash32: [at.flash, 32, true],
      flash16: [at.flash, 16, true],
      flash8: [at.flash, 8, true],
    };
    this.drop();
    this.core = null;
    this.env = { memory: this.memory, table: this.table };
    this.types = {}; // of what code can call: parameters and results
    this.makeBase();
  }

  /** Give a chip this memory; all but the flash is as after power-up. Its core is to be made. */
  attach(chip) {
    for (const array of [this.registers, this.state, this.xipOld, this.xipPresent, this.ram]) array.fill(0);
    this.xipTags.fill(-1);
    const { ram, flash } = this;
    chip.sram = ram;
    chip.sramView = new DataView(ram.buffer, ram.byteOffset, ram.length);
    chip.flash = flash;
    chip.flash16 = this.flash16;
    chip.flashView = new DataView(flash.buffer, flash.byteOffset, flash.length);
  }

  /** The functions of a module: [name, text, parameters] each; `held`: words that they have in locals. */
  functions(sources, held = []) {
    const called = new Set(sources.flatMap(([, text]) => text.match(/core\.\w+/g) ?? []).map((call) => call.slice(5)));
    const indirect = called.delete('run');
    const names = [...called];
    const calls = { run: INDIRECT };
    names.forEach((name, i) => (calls[name] = i));
    const imports = names.map((name) => [name, this.types[name]]);
    const exported = sources.map(([name, text, parameters]) => [name, [parameters.length, text.includes('return') ? 1 : 0]]);
    const { words, arrays } = this;
    const codes = sources.map(([, text, parameters]) => assemble(text, { words, arrays, calls, held }, parameters));
    const module = new WebAssembly.Module(moduleMaker(PIECE, imports, exported, indirect)(...codes));
    return new WebAssembly.Instance(module, { env: this.env }).exports;
  }

  /** Code can call these: `actions` without a result, `values` with one. */
  offer(actions, values) {
    Object.assign(this.env, actions, values);
    for (const [results, group] of [actions, values].entries()) {
      for (const [name, call] of Object.entries(group)) this.types[name] = [call.length, results];
    }
  }
  /** The same of text: [name, text, parameters]. */
  offerText(helpers) {
    const functions = this.functions(helpers);
    for (const [name, text] of helpers) this.offer(...(text.includes('return') ? [{}, { [name]: functions[name] }] : [{ [name]: functions[name] }, {}]));
  }

  makeBase() {
    // a function for each, since V8 knows then what it calls
    this.offer(
      {
        st32: (address, value, k) => this.core.at(k, this.core.store32, address, value),
        st16: (address, value, k) => this.core.at(k, this.core.store16, address, value),
        st8: (address, value, k) => this.core.at(k, this.core.store8, address, value),
        miss: (line) => this.core.xipTouch(line << 3),
        bkpt: (number, pc) => this.core.bkpt(number, pc),
        undefined: (halfword) => this.core.undefined(halfword),
        hint: (number) => this.core.hint(number),
        wide: (first, second) => this.core.wide(first, second),
        cps: (disable, _which) => this.core.cps(disable),
        svc: () => this.core.svc(),
        note: (pc) => this.core.profile.note(pc, this.core.cyc),
        often: (pc) => this.often(pc),
        stale: (pc) => this.stale(pc),
      },
      {
        slow32: (address, k) => this.core.at(k, this.core.load32, address),
        slow16: (address, k) => this.core.at(k, this.core.load16, address),
        slow8: (address, k) => this.core.at(k, this.core.load8, address),
        slowFetch: (pc) => this.core.slowFetch(pc),
        bx: (to, next, thumb) => this.core.bx(to, next, thumb),
      },
    );
    this.offerText(HELPERS);
    this.emitter = new Piece((pc) => this.halfword(pc));
    this.run = this.functions([['interpret', new Interpreter().text(this.hot), ['how']]]).interpret;
  }

  halfword(pc) {
    return pc >>> 24 === 0x20 ? this.ram16[(pc - RAM_BASE) >> 1] : this.flash16[(pc - FLASH_BASE) >> 1];
  }

  entryOf(pc) {
    return pc >>> 24 === 0x20 ? [this.ramEntries, (pc - RAM_BASE) >> 1] : [this.flashEntries, (pc - FLASH_BASE) >> 1];
  }

  /** Whether there is a piece at an address. */
  has(pc) {
    const [entries, index] = this.entryOf(pc);
    return entries[index] > 0;
  }

  /** Code has branched to `pc` so often that a piece is to be made of it, or twice as often, and it has waited for others for too long. */
  often(pc) {
    const [entries, index] = this.entryOf(pc);
    if (entries[index] === -this.hot) {
      this.waiting.push(pc);
      if (this.waiting.length < this.batch) return;
    }
    this.link(this.waiting);
    this.waiting = [];
  }

  /** Make a module of the pieces at some addresses. */
  link(places) {
    if (this.pieces > MOST) this.drop();
    const made = places.map((pc) => this.emitter.piece(pc));
    const first = this.putInTable(made.map(({ text }) => text), this.layout.held);
    for (const [i, pc] of places.entries()) {
      this.placed(first + i, pc);
      const [entries, index] = this.entryOf(pc);
      if (entries === this.flashEntries) this.sources.push([index, this.flash16.slice(index, (made[i].last - FLASH_BASE) >> 1)]);
    }
  }
  placed(number, pc) {
    const [entries, index] = this.entryOf(pc);
    entries[index] = number;
  }

  /** Return the number of the first one of some functions. */
  putInTable(texts, held) {
    const functions = this.functions(texts.map((text, i) => [String(i), text, []]), held);
    const first = this.pieces + 1;
    this.pieces += texts.length;
    if (this.pieces >= this.table.length) this.table.grow(1024 + texts.length);
    texts.forEach((_, i) => this.table.set(first + i, functions[i]));
    return first;
  }

  drop() {
    this.ramEntries.fill(0);
    this.flashEntries.fill(0);
    this.pieces = 0;
    this.waiting = []; // their addresses
    this.sources = []; // of pieces in flash: index of the first halfword, and all of them
  }

  /** The code of the piece at `pc` in RAM has changed. */
  stale(pc) {
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

  /** The flash may have changed from one address in it to another one: drop pieces of what is no longer there. */
  check(from = 0, to = this.flash.length) {
    const { flash16, flashEntries } = this;
    this.sources = this.sources.filter(([first, halfwords]) => {
      if (2 * first >= to || 2 * (first + halfwords.length) <= from) return true;
      if (halfwords.every((halfword, i) => halfword === flash16[first + i])) return true;
      flashEntries[first] = 0;
      return false;
    });
  }
}
