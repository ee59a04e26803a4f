// A Cortex-M33 of an RP2350, secure state only, with the interface that the board and the peripherals expect of
// core.mjs. Code runs as JavaScript made by emit.mjs, a piece at a time; interrupts are taken between pieces.

import { Dcp } from './dcp.mjs';
import { Emitter } from './emit.mjs';

export const RAM_SIZE = 0x82000;
const RAM_BASE = 0x20000000;
const FLASH_BASE = 0x10000000;
const ROM_SIZE = 0x8000;
const DPRAM_BASE = 0x50100000;
const EXC_NMI = 2;
const EXC_HARDFAULT = 3;
const EXC_SVCALL = 11;
const EXC_PENDSV = 14;
const EXC_SYSTICK = 15;
const THREAD_PRIORITY = 256;
const ENTRY_CYCLES = 12; // Arm's figure for the interrupt latency
const RETURN_CYCLES = 8; // estimated
const APB_EXTRA = 3; // a bridge access, as on the RP2040
const XIP_SETS = 1024; // 16 KB, two ways, lines of 8 bytes
const WAIT_EVENT = 1;
const WAIT_INTERRUPT = 2;

const HEADER = 'let a,o,b,t,p,q,x,y,w;';

export class M33 {
  // No part of the chip's state: code by its address, and what makes it
  #inFlash;
  #inRam;
  #inRom;
  #emitter;
  #nowhere = Object.assign(() => this.#nowhere, { pc: 0, max: 1 }); // after a jump outside the memory
  #stopped = new Map(); // where pieces have ended at the limit, and go on
  #next = null; // piece that is next
  #codeEnd = 0; // of what in the flash has become code
  #codeFlash; // the flash of which it was made

  constructor(chip, { xipMiss = 0, onHalt = () => {} } = {}) {
    this.chip = this.rp2040 = chip;
    this.clock = chip.clock;
    this.onHalt = onHalt;
    this.r = new Int32Array(16);
    this.registers = new Uint32Array(this.r.buffer);
    this.s = new Float32Array(64);
    this.si = new Int32Array(this.s.buffer);
    this.fpscr = 0;
    // cycles, limit, nz, c, v, q, exclusive monitor, high word of a product, CONTROL.FPCA
    this.st = new Int32Array(16);
    this.st[2] = 1;
    this.ge = 0;
    this.dcp = new Dcp();
    this.ram8 = chip.sram;
    this.ram16 = new Uint16Array(this.ram8.buffer, this.ram8.byteOffset, RAM_SIZE / 2);
    this.ram32 = new Int32Array(this.ram8.buffer, this.ram8.byteOffset, RAM_SIZE / 4);
    this.rom16 = new Uint16Array(chip.bootrom.buffer);
    this.rom32 = new Int32Array(chip.bootrom.buffer);
    this.rom8 = new Uint8Array(chip.bootrom.buffer);
    this.flash8 = chip.flash;
    this.flash16 = new Uint16Array(chip.flash.buffer, chip.flash.byteOffset, chip.flash.length / 2);
    this.flash32 = new Int32Array(chip.flash.buffer, chip.flash.byteOffset, chip.flash.length / 4);
    this.flashMask = chip.flash.length - 1;
    this.dpram8 = chip.usbDPRAM;
    this.dpram32 = new Int32Array(chip.usbDPRAM.buffer);
    this.dpram16 = new Uint16Array(chip.usbDPRAM.buffer);

    this.PM = 0;
    this.FM = 0;
    this.basepri = 0;
    this.control = 0;
    this.spsel = 0;
    this.otherSP = 0;
    this.msplim = this.psplim = 0;
    this.handlerMode = false;
    this.IPSR = 0;
    this.enabled = new Int32Array(2);
    this.pending = new Int32Array(2);
    this.lines = new Int32Array(2); // levels of the interrupt lines
    this.active = new Set();
    this.priorities = new Uint8Array(64);
    this.shpr = new Uint8Array(16);
    this.pendingPendSV = this.pendingSystick = this.pendingSVCall = false;
    this.VTOR = 0;
    this.SCR = 0;
    this.cpacr = 0;
    this.ppbWords = new Map();
    this.systick = { ctrl: 0, reload: 0, base: 0, alarm: chip.clock.createAlarm(() => this.systickFires()) };
    this.eventRegistered = false;
    this.waiting = 0;
    this.halted = false;

    this.cycleNanos = 1e9 / 150e6;
    this.budget = 0;
    this.sliceStart = this.sliceEnd = 0;
    this.irqCheck = false;
    this.totalCycles = 0;
    this.stop = false;
    this.romCall = null;
    this.excCount = new Float64Array(80);
    this.excCycles = new Float64Array(80);
    this.excMax = new Float64Array(80);
    this.excStack = []; // number and first cycle of the exceptions that run
    this.maskedSince = 0; // cycles when PRIMASK was set
    this.flashBusy = false; // the flash was erased or written since then
    this.longestMasked = { cycles: 0, endNanos: 0 };

    this.xipMiss = xipMiss;
    this.xipTags = new Int32Array(2 * XIP_SETS).fill(-1);
    this.xipOld = new Uint8Array(XIP_SETS);
    this.xp = new Uint8Array(chip.flash.length / 8); // 1, 2: the line is in that half
    this.xipLast = -1; // line that was read last, and when that was done
    this.xipEnd = 0;
    this.xipMisses = 0;
    this.xipAccesses = 0;

    this.#codeFlash = this.flash32.slice();
    this.#inFlash = new Array(chip.flash.length / 2).fill(null);
    this.#inRam = new Array(RAM_SIZE / 2).fill(null);
    this.#inRom = new Array(ROM_SIZE / 2).fill(null);
    const names = ['core', 'r', 'st', 's', 'si', 'ram8', 'ram16', 'ram32', 'xp', 'xo'];
    const values = [this, this.r, this.st, this.s, this.si, this.ram8, this.ram16, this.ram32, this.xp, this.xipOld];
    this.make = (body, links, before = '') =>
      new Function(...names, `${before}${links ? `let ${Array.from({ length: links }, (_, i) => `n${i}=null`).join(',')};` : ''}const self=function(e){${HEADER}${body}};return self`)(...values);
    const line = (pc) => {
      if (!this.xipMiss || pc >>> 24 !== 0x10) return '';
      const index = (pc & this.flashMask) >>> 3;
      return `if(xp[${index}]===0)core.xipLine(${index});else xo[${index & (XIP_SETS - 1)}]=xp[${index}];`;
    };
    const literal = (at, size) => {
      if (at >>> 24 !== 0x10) return null;
      const offset = at & this.flashMask;
      if (size === 32) return offset & 3 ? null : this.flash32[offset >> 2];
      return size === 16 ? this.flash16[offset >> 1] : this.flash8[offset];
    };
    this.#emitter = new Emitter((pc) => this.fetch(pc), { line: this.xipMiss ? line : null, literal });
  }

  // ------------------------------------------------------------------ code

  fetch(pc) {
    const top = pc >>> 24;
    if (top === 0x20) return this.ram16[(pc & 0xffffff) >> 1];
    if (top >= 0x10 && top < 0x14) return this.flash16[(pc & this.flashMask) >> 1];
    return this.rom16[pc >> 1];
  }

  compile(pc, stops = false) {
    const top = pc >>> 24;
    const inRam = top === 0x20 && (pc & 0xffffff) < RAM_SIZE;
    if (!inRam && !(top >= 0x10 && top < 0x14) && pc >>> 0 >= ROM_SIZE) {
      this.r[15] = pc;
      this.halt('instruction fetch outside the memory');
      return null;
    }
    const { text, end, links, max, places } = this.#emitter.piece(pc, stops);
    let head = '';
    if (inRam) {
      const first = (pc & 0xffffff) >> 2;
      const last = (end - 1 & 0xffffff) >> 2;
      const tests = [];
      for (let i = first; i <= last; i++) tests.push(`ram32[${i}]!==${this.ram32[i]}`);
      head = `if(${tests.join('||')})return core.stale(${stops ? 'at[e]' : pc},self);`;
    }
    const code = stops
      ? this.make(`${head}st[0]-=cycles[e];${text}`, links, `const at=[${places.map((place) => place.pc)}],cycles=[${places.map((place) => place.cycles)}];`)
      : this.make(head + text, links);
    code.pc = pc;
    code.max = max;
    if (stops) {
      code.places = places;
      code.goesOn = new Array(places.length);
    } else if (inRam) this.#inRam[(pc & 0xffffff) >> 1] = code;
    else if (top) {
      this.#inFlash[(pc & this.flashMask) >> 1] = code;
      this.#codeEnd = Math.max(this.#codeEnd, (end & this.flashMask) + 8192);
    }
    else this.#inRom[pc >> 1] = code;
    return code;
  }

  /** Code in RAM that has changed: go on with what is there now. */
  stale(pc, code) {
    const old = code.of ?? code;
    const at = (old.pc & 0xffffff) >> 1;
    if (this.#inRam[at] === old) this.#inRam[at] = null;
    this.#stopped.clear();
    return this.find(pc);
  }

  /** The code at an address, where the core goes on. */
  find(pc) {
    let code = null;
    const f = (pc - FLASH_BASE) >>> 0;
    if (f < this.flash8.length) code = this.#inFlash[f >> 1];
    else {
      const m = (pc - RAM_BASE) >>> 0;
      if (m < RAM_SIZE) code = this.#inRam[m >> 1];
      else if (pc >>> 0 < ROM_SIZE) code = this.#inRom[pc >> 1];
      else if (pc >>> 24 === 0xff) {
        this.exceptionReturn(pc);
        return this.#stopped.get(this.r[15]) ?? this.find(this.r[15]);
      }
    }
    return code !== null ? code : this.compile(pc) ?? this.#nowhere;
  }

  /** The memory has another content: code stays if it is still in the flash. That in RAM looks for itself. */
  restored() {
    const end = this.#codeEnd >> 2;
    let same = 0;
    while (same < end && this.flash32[same] === this.#codeFlash[same]) same++;
    this.flashChanged(same < end ? 0 : this.#codeEnd, this.flash8.length);
    this.#next = null;
  }

  flashChanged(from, to) {
    if (from < this.#codeEnd) {
      this.#inFlash.fill(null);
      this.#inRam.fill(null);
      this.#inRom.fill(null);
      this.#stopped.clear();
      this.#next = null;
      this.#codeEnd = 0;
    }
    this.#codeFlash.set(this.flash32.subarray(from >> 2, (to + 3) >> 2), from >> 2);
  }

  // ------------------------------------------------------------------ running

  get cycles() {
    return this.totalCycles + this.st[0];
  }
  set cycles(_value) {}
  get logger() {
    return this.chip.logger;
  }

  run(endNanos) {
    const { st, r } = this;
    this.sliceStart = this.clock.nanosCounter;
    this.sliceEnd = endNanos;
    st[0] = 0;
    this.budget = Math.max(1, Math.ceil((endNanos - this.sliceStart) / this.cycleNanos - 1e-6));
    do {
      if (this.irqCheck) {
        this.irqCheck = false;
        this.takeInterrupt();
      }
      st[1] = this.budget;
      this.execute();
    } while (st[0] < this.budget && !this.waiting && !this.halted && !this.stop);
    this.totalCycles += st[0];
    this.clock.nanosCounter = this.sliceStart + st[0] * this.cycleNanos;
    st[0] = 0;
    void r;
  }

  /** Run pieces that end before the limit, and of the last one the instructions that begin before it. */
  execute() {
    const { st, r } = this;
    let code = this.#next;
    if (code === null || code.pc !== r[15]) code = this.#stopped.get(r[15]) ?? this.find(r[15]);
    for (;;) {
      while (st[0] + code.max <= st[1]) code = code();
      if (st[0] >= st[1]) break;
      if (!code.stops) {
        code.stops = this.compile(code.pc, true) ?? this.#nowhere;
        code.stops.of = code;
      }
      code = code.stops(0);
    }
    r[15] = code.pc;
    this.#next = code;
  }

  /** Return what goes on at a place of a piece that has ended at the limit. */
  stopped(piece, place) {
    const { pc, cycles } = piece.places[place];
    const known = piece.goesOn[place];
    if (known) return known;
    const code = Object.assign(() => piece(place), { pc, max: piece.max - cycles, stops: null });
    code.stops = code;
    this.#stopped.set(pc, code);
    return (piece.goesOn[place] = code);
  }

  leave() {
    this.stop = true;
    this.st[1] = -1;
  }

  halt(reason) {
    this.st[1] = -1;
    if (this.halted) return;
    this.halted = true;
    const hex = (n) => '0x' + (n >>> 0).toString(16);
    this.onHalt(`${reason} (pc ${hex(this.r[15])}, lr ${hex(this.r[14])}, sp ${hex(this.r[13])}, ipsr ${this.IPSR})`);
  }

  undefined(pc, hex) {
    this.r[15] = pc;
    this.halt(`undefined instruction ${hex} at ${(pc >>> 0).toString(16)}`);
  }

  fault(reason) {
    this.halt(`fault: ${reason}`);
    return 0;
  }

  bkpt(n, pc, next) {
    this.r[15] = next;
    if (pc >>> 0 < ROM_SIZE && this.romCall) this.romCall(n);
    else {
      this.r[15] = pc;
      this.halt(`breakpoint #${n}`);
    }
  }

  // ------------------------------------------------------------------ memory

  now(extra) {
    return this.sliceStart + (this.st[0] + extra) * this.cycleNanos;
  }
  /** Before touching a peripheral: what is due happens first. */
  sync(extra) {
    const { clock } = this;
    const now = this.now(extra);
    if (clock.nextNanos <= now) clock.fireUntil(now);
    else if (now > clock.nanosCounter) clock.nanosCounter = now;
  }
  after() {
    const next = this.clock.nextNanos;
    if (next < this.sliceEnd) {
      this.sliceEnd = next;
      this.budget = Math.max(0, Math.ceil((next - this.sliceStart) / this.cycleNanos));
      if (this.st[1] > this.budget) this.st[1] = this.budget;
    }
  }

  xipLine(line) {
    const { xipTags, xipOld, xp } = this;
    const set = line & (XIP_SETS - 1);
    const { qmi } = this.chip;
    const begin = this.cycles;
    this.st[0] += line === this.xipLast + 1 && begin - this.xipEnd <= qmi.cooldown ? qmi.next : qmi.first;
    this.xipLast = line;
    this.xipEnd = this.cycles;
    this.xipMisses++;
    const half = xipOld[set] === 1 ? 2 : 1;
    const place = half === 2 ? set + XIP_SETS : set;
    if (xipTags[place] >= 0) xp[xipTags[place]] = 0;
    xipTags[place] = line;
    xp[line] = half;
    xipOld[set] = half;
  }
  xipFlush() {
    this.xipLast = -1;
    this.xipTags.fill(-1);
    this.xp.fill(0);
  }
  touch(offset) {
    if (!this.xipMiss) return;
    const line = offset >>> 3;
    if (this.xp[line] === 0) this.xipLine(line);
    else this.xipOld[line & (XIP_SETS - 1)] = this.xp[line];
  }

  ld32(a, k) {
    if (a >>> 24 === 0x10 && !(a & 3)) {
      const offset = a & this.flashMask;
      if (this.xipMiss) this.touch(offset);
      return this.flash32[offset >> 2];
    }
    return this.slowLoad32(a, k) | 0;
  }
  slowLoad32(a, k) {
    const top = a >>> 24;
    if (a & 3) {
      if (top !== 0x20 && (top < 0x10 || top >= 0x14) && a >>> 0 >= ROM_SIZE) return this.fault(`unaligned read of ${(a >>> 0).toString(16)}`);
      this.st[0] += 1;
      return this.ld8(a, k) | (this.ld8(a + 1, k) << 8) | (this.ld8(a + 2, k) << 16) | (this.ld8(a + 3, k) << 24);
    }
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) return this.ram32[(a & 0xffffff) >> 2];
    if (top >= 0x10 && top < 0x18) return this.flash32[(a & this.flashMask) >> 2];
    if (a >>> 0 < ROM_SIZE) return this.rom32[a >> 2];
    if ((a & 0xfffff000) === DPRAM_BASE) return this.dpram32[(a & 0xfff) >> 2];
    this.sync(k);
    if (top === 0xd0) {
      const value = this.chip.sio.readUint32(a & 0xffff);
      this.after();
      return value;
    }
    if (top === 0xe0) return this.ppbRead(a & 0xfffff, k);
    if (top === 0x40) this.st[0] += APB_EXTRA;
    else if (top !== 0x50) return this.fault(`read of ${(a >>> 0).toString(16)}`);
    const value = this.chip.readPeripheral(a >>> 0);
    this.after();
    return value;
  }
  ld16(a, k) {
    const top = a >>> 24;
    if (a & 1) return this.ld8(a, k) | (this.ld8(a + 1, k) << 8);
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) return this.ram16[(a & 0xffffff) >> 1];
    if (top >= 0x10 && top < 0x18) {
      if (top === 0x10) this.touch(a & this.flashMask);
      return this.flash16[(a & this.flashMask) >> 1];
    }
    if (a >>> 0 < ROM_SIZE) return this.rom16[a >> 1];
    const word = this.ld32(a & ~3, k);
    return a & 2 ? word >>> 16 : word & 0xffff;
  }
  ld8(a, k) {
    const top = a >>> 24;
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) return this.ram8[a & 0xffffff];
    if (top >= 0x10 && top < 0x18) {
      if (top === 0x10) this.touch(a & this.flashMask);
      return this.flash8[a & this.flashMask];
    }
    if (a >>> 0 < ROM_SIZE) return this.rom8[a];
    const word = this.ld32(a & ~3, k);
    return (word >>> ((a & 3) * 8)) & 0xff;
  }
  st32(a, value, k) {
    const top = a >>> 24;
    if (a & 3) {
      if (top !== 0x20) return void this.fault(`unaligned write of ${(a >>> 0).toString(16)}`);
      this.st[0] += 1;
      for (let i = 0; i < 4; i++) this.st8((a + i) | 0, value >>> (8 * i), k);
      return;
    }
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) {
      this.ram32[(a & 0xffffff) >> 2] = value;
      return;
    }
    if ((a & 0xfffff000) === DPRAM_BASE) {
      this.dpram32[(a & 0xfff) >> 2] = value;
      if ((a & 0xfff) < 0x100) {
        this.sync(k);
        this.chip.usbCtrl.DPRAMUpdated(a & 0xfff, value >>> 0);
        this.after();
      }
      return;
    }
    if (top >= 0x10 && top < 0x20) return; // cache maintenance
    if (a >>> 0 < ROM_SIZE) return;
    this.sync(k);
    if (top === 0xd0) this.chip.sio.writeUint32(a & 0xffff, value >>> 0);
    else if (top === 0xe0) this.ppbWrite(a & 0xfffff, value >>> 0, k);
    else if (top === 0x40 || top === 0x50) {
      if (top === 0x40) this.st[0] += APB_EXTRA;
      this.chip.writePeripheral(a >>> 0, value >>> 0);
    } else return void this.fault(`write of ${(a >>> 0).toString(16)}`);
    this.after();
  }
  st16(a, value, k) {
    const top = a >>> 24;
    if (a & 1) {
      this.st8(a, value, k);
      this.st8((a + 1) | 0, value >>> 8, k);
    } else if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) this.ram16[(a & 0xffffff) >> 1] = value;
    else if ((a & 0xfffff000) === DPRAM_BASE) {
      this.dpram16[(a & 0xfff) >> 1] = value;
      if ((a & 0xfff) < 0x100) this.st32(a & ~3, this.dpram32[(a & 0xfff) >> 2], k);
    } else this.st32(a & ~3, (value & 0xffff) * 0x10001, k);
  }
  st8(a, value, k) {
    const top = a >>> 24;
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) this.ram8[a & 0xffffff] = value;
    else if ((a & 0xfffff000) === DPRAM_BASE) {
      this.dpram8[a & 0xfff] = value;
      if ((a & 0xfff) < 0x100) this.st32(a & ~3, this.dpram32[(a & 0xfff) >> 2], k);
    } else if (top === 0xe0 && (a & 0xfff00) >= 0xe400 && (a & 0xfffff) < 0xe500) this.priorities[(a & 0xfffff) - 0xe400] = value & 0xf0;
    else if (top === 0xe0 && (a & 0xfffff) >= 0xed18 && (a & 0xfffff) < 0xed24) this.shpr[(a & 0xfffff) - 0xed14] = value & 0xf0;
    else this.st32(a & ~3, (value & 0xff) * 0x01010101, k);
  }
  // for the boot ROM, and what the board's own ROM expects
  load8(a) {
    return this.ld8(a, 0);
  }
  store8(a, value) {
    this.st8(a, value, 0);
  }
  load32(a) {
    return this.ld32(a, 0);
  }
  store32(a, value) {
    this.st32(a, value, 0);
  }
  get cyc() {
    return this.st[0];
  }
  set cyc(value) {
    this.st[0] = value;
  }

  // ------------------------------------------------------------------ private peripheral bus

  ppbRead(offset, k) {
    if (offset >= 0xe100 && offset < 0xe108) return this.enabled[(offset >> 2) & 1];
    if (offset >= 0xe180 && offset < 0xe188) return this.enabled[(offset >> 2) & 1];
    if (offset >= 0xe200 && offset < 0xe208) return this.pending[(offset >> 2) & 1];
    if (offset >= 0xe280 && offset < 0xe288) return this.pending[(offset >> 2) & 1];
    if (offset >= 0xe400 && offset < 0xe440) {
      const i = offset - 0xe400;
      const p = this.priorities;
      return p[i] | (p[i + 1] << 8) | (p[i + 2] << 16) | (p[i + 3] << 24);
    }
    if (offset >= 0xed18 && offset < 0xed24) {
      const i = offset - 0xed14;
      const p = this.shpr;
      return p[i] | (p[i + 1] << 8) | (p[i + 2] << 16) | (p[i + 3] << 24);
    }
    switch (offset) {
      case 0xe004: return 1; // ICTR
      case 0xe010: { const { ctrl } = this.systick; return ctrl; }
      case 0xe014: return this.systick.reload;
      case 0xe018: {
        const { ctrl, reload, base } = this.systick;
        if (!(ctrl & 1) || !reload) return 0;
        const ticks = Math.floor((this.now(k) - base) / (ctrl & 4 ? this.cycleNanos : 1000));
        return reload - (ticks % (reload + 1));
      }
      case 0xe01c: return 9999;
      case 0xed00: return 0x411fd210; // CPUID of a Cortex-M33 r1p0
      case 0xed04: return (this.IPSR | (this.pendingPendSV ? 1 << 28 : 0) | (this.pendingSystick ? 1 << 26 : 0)) | (this.pick(THREAD_PRIORITY) << 12);
      case 0xed08: return this.VTOR;
      case 0xed0c: return 0xfa050000;
      case 0xed10: return this.SCR;
      case 0xed88: return this.cpacr;
      case 0x1004: return this.cycles | 0; // DWT_CYCCNT
    }
    return this.ppbWords.get(offset) ?? 0;
  }
  ppbWrite(offset, value, k) {
    if (offset >= 0xe100 && offset < 0xe108) {
      this.enabled[(offset >> 2) & 1] |= value;
      this.check();
    } else if (offset >= 0xe180 && offset < 0xe188) this.enabled[(offset >> 2) & 1] &= ~value;
    else if (offset >= 0xe200 && offset < 0xe208) {
      this.pending[(offset >> 2) & 1] |= value;
      this.check();
    } else if (offset >= 0xe280 && offset < 0xe288) this.pending[(offset >> 2) & 1] &= ~value;
    else if (offset >= 0xe400 && offset < 0xe440) for (let i = 0; i < 4; i++) this.priorities[offset - 0xe400 + i] = (value >>> (8 * i)) & 0xf0;
    else if (offset >= 0xed18 && offset < 0xed24) for (let i = 0; i < 4; i++) this.shpr[offset - 0xed14 + i] = (value >>> (8 * i)) & 0xf0;
    else {
      switch (offset) {
        case 0xe010:
          this.systick.ctrl = value & 7;
          this.systick.base = this.now(k);
          this.systickArm();
          return;
        case 0xe014: this.systick.reload = value & 0xffffff; return;
        case 0xe018:
          this.systick.base = this.now(k);
          this.systickArm();
          return;
        case 0xed04:
          if (value & (1 << 28)) this.pendingPendSV = true;
          if (value & (1 << 27)) this.pendingPendSV = false;
          if (value & (1 << 26)) this.pendingSystick = true;
          if (value & (1 << 25)) this.pendingSystick = false;
          this.check();
          return;
        case 0xed08: this.VTOR = value & ~0x7f; return;
        case 0xed0c:
          if (value >>> 16 === 0x05fa && value & 4) this.chip.onReset('SYSRESETREQ');
          return;
        case 0xed10: this.SCR = value & 0x1e; return;
        case 0xed88: this.cpacr = value; return;
        case 0xef00: // STIR
          this.pending[(value & 0x3f) >> 5] |= 1 << (value & 31);
          this.check();
          return;
      }
      this.ppbWords.set(offset, value | 0);
    }
  }
  systickArm() {
    const { ctrl, reload, alarm } = this.systick;
    alarm.cancel();
    if ((ctrl & 3) === 3 && reload) alarm.scheduleAt(this.systick.base + (reload + 1) * (ctrl & 4 ? this.cycleNanos : 1000));
  }
  systickFires() {
    this.systick.base = this.systick.alarm.nanos;
    this.pendingSystick = true;
    this.systickArm();
    this.check();
  }

  // ------------------------------------------------------------------ exceptions

  setInterrupt(irq, value) {
    const word = irq >> 5;
    const bit = 1 << (irq & 31);
    if (!value) {
      this.lines[word] &= ~bit;
      this.pending[word] &= ~bit; // as core.mjs; the peripherals hold their lines
      return;
    }
    this.lines[word] |= bit;
    if (this.pending[word] & bit) return;
    this.pending[word] |= bit;
    if (this.SCR & 0x10) this.sev();
    if (this.enabled[word] & bit) this.check();
  }
  check() {
    this.irqCheck = true;
    this.st[1] = -1;
    if (this.waiting) this.wake();
  }
  wake() {
    const n = this.pick(THREAD_PRIORITY);
    if (!n) return;
    if (this.waiting === WAIT_INTERRUPT || this.priorityOf(n) < this.executionPriority) this.waiting = 0;
  }
  priorityOf(n) {
    if (n === EXC_NMI) return -2;
    if (n === EXC_HARDFAULT) return -1;
    return n < 16 ? this.shpr[n] : this.priorities[n - 16];
  }
  get executionPriority() {
    let priority = THREAD_PRIORITY;
    if (this.IPSR) for (const n of this.active) priority = Math.min(priority, this.priorityOf(n));
    if (this.basepri) priority = Math.min(priority, this.basepri);
    if (this.PM) priority = Math.min(priority, 0);
    if (this.FM) priority = -1;
    return priority;
  }
  pick(below) {
    let best = 0;
    let priority = below;
    const consider = (n) => {
      const p = this.priorityOf(n);
      if (p < priority) {
        priority = p;
        best = n;
      }
    };
    if (this.pendingSVCall) consider(EXC_SVCALL);
    if (this.pendingPendSV) consider(EXC_PENDSV);
    if (this.pendingSystick) consider(EXC_SYSTICK);
    for (let word = 0; word < 2; word++) {
      let bits = this.pending[word] & this.enabled[word];
      while (bits) {
        const i = 31 - Math.clz32(bits & -bits);
        bits &= bits - 1;
        consider(16 + 32 * word + i);
      }
    }
    return best;
  }
  takeInterrupt() {
    const n = this.pick(this.executionPriority);
    if (!n) return;
    if (n === EXC_SVCALL) this.pendingSVCall = false;
    else if (n === EXC_PENDSV) this.pendingPendSV = false;
    else if (n === EXC_SYSTICK) this.pendingSystick = false;
    else if (n >= 16 + 46) this.pending[1] &= ~(1 << (n - 48));
    this.exceptionEntry(n);
  }
  useStack(which) {
    if (this.spsel !== which) {
      const sp = this.r[13];
      this.r[13] = this.otherSP;
      this.otherSP = sp;
      this.spsel = which;
      this.limitStack();
    }
  }
  limitStack() {
    this.st[9] = this.spsel ? this.psplim : this.msplim;
  }
  overflow() {
    this.fault(`the stack pointer is below its limit ${(this.st[9] >>> 0).toString(16)}`);
  }
  get apsr() {
    const { st } = this;
    return (st[2] < 0 ? 0x80000000 : 0) | (st[2] === 0 ? 0x40000000 : 0) | (st[3] ? 0x20000000 : 0) | (st[4] ? 0x10000000 : 0) | (st[5] ? 0x08000000 : 0) | (this.ge << 16);
  }
  set apsr(value) {
    const { st } = this;
    st[2] = value & 0x80000000 ? -1 : value & 0x40000000 ? 0 : 1;
    st[3] = (value >>> 29) & 1;
    st[4] = (value >>> 28) & 1;
    st[5] = (value >>> 27) & 1;
    this.ge = (value >>> 16) & 15;
  }
  exceptionEntry(n) {
    const { r, st, si } = this;
    this.excStack.push(n, this.cycles);
    const fp = st[8] && !(this.ppbWords.get(0xef34) === 0);
    const size = fp ? 0x68 : 0x20;
    const align = r[13] & 4 ? 1 : 0;
    const frame = ((r[13] - size) & ~7) | 0;
    const put = (offset, value) => this.st32((frame + offset) | 0, value, 0);
    put(0, r[0]);
    put(4, r[1]);
    put(8, r[2]);
    put(12, r[3]);
    put(16, r[12]);
    put(20, r[14]);
    put(24, r[15] & ~1);
    put(28, (this.apsr & ~0x200) | this.IPSR | (1 << 24) | (align << 9));
    if (fp) {
      for (let i = 0; i < 16; i++) put(0x20 + 4 * i, si[i]);
      put(0x60, this.fpscr);
    }
    r[13] = frame;
    if (frame < st[9]) this.overflow();
    r[14] = (this.handlerMode ? 0xfffffff1 : this.spsel ? 0xfffffffd : 0xfffffff9) & (fp ? ~0x10 : ~0);
    this.handlerMode = true;
    this.IPSR = n;
    this.active.add(n);
    this.useStack(0);
    st[8] = 0;
    st[6] = 0;
    this.waiting = 0;
    this.eventRegistered = true;
    r[15] = this.ld32((this.VTOR + 4 * n) | 0, 0) & ~1;
    st[0] += ENTRY_CYCLES;
    this.excCount[n]++;
  }
  exceptionReturn(code) {
    const { r, st, si } = this;
    this.active.delete(this.IPSR);
    if (this.IPSR !== EXC_NMI) this.FM = 0;
    // a line that is still high makes its interrupt pending again
    if (code & 8) {
      this.handlerMode = false;
      if (code & 4) this.useStack(1);
    }
    const fp = !(code & 0x10);
    const frame = r[13];
    const get = (offset) => this.ld32((frame + offset) | 0, 0);
    r[0] = get(0);
    r[1] = get(4);
    r[2] = get(8);
    r[3] = get(12);
    r[12] = get(16);
    r[14] = get(20);
    r[15] = get(24) & ~1;
    const psr = get(28);
    if (fp) {
      for (let i = 0; i < 16; i++) si[i] = get(0x20 + 4 * i);
      this.fpscr = get(0x60);
    }
    r[13] = ((frame + (fp ? 0x68 : 0x20)) | 0) | (psr & 0x200 ? 4 : 0);
    this.apsr = psr;
    this.IPSR = this.handlerMode ? psr & 0x1ff : 0;
    st[8] = fp ? 4 : 0;
    st[6] = 0;
    st[0] += RETURN_CYCLES;
    this.eventRegistered = true;
    this.irqCheck = true;
    st[1] = -1;
    if (this.excStack.length) {
      const start = this.excStack.pop();
      const n = this.excStack.pop();
      const spent = this.cycles - start;
      this.excCycles[n] += spent;
      if (spent > this.excMax[n]) this.excMax[n] = spent;
    }
  }
  /** Set PRIMASK, and keep the longest time that it was set for. */
  mask(on) {
    if (on === this.PM) return;
    this.PM = on;
    if (on) {
      this.maskedSince = this.cycles;
      this.flashBusy = false;
      return;
    }
    const cycles = this.cycles - this.maskedSince;
    if (cycles > this.longestMasked.cycles && !this.flashBusy) {
      this.longestMasked = { cycles, endNanos: this.now(0) };
    }
  }

  svc() {
    this.pendingSVCall = true;
    this.check();
  }
  cps(disable, which) {
    if (which & 2) this.mask(disable ? 1 : 0);
    if (which & 1) this.FM = disable;
    if (!disable) this.check();
  }
  wfe() {
    if (this.eventRegistered) this.eventRegistered = false;
    else {
      this.waiting = WAIT_EVENT;
      this.st[1] = -1;
      this.wake();
    }
  }
  wfi() {
    this.waiting = WAIT_INTERRUPT;
    this.st[1] = -1;
    this.wake();
  }
  sev() {
    if (this.waiting === WAIT_EVENT) this.waiting = 0;
    else this.eventRegistered = true;
  }
  sendEvent() {
    this.sev();
  }

  mrs(n) {
    switch (n) {
      case 0: case 2: return this.apsr;
      case 1: case 3: case 7: return this.apsr | this.IPSR;
      case 5: case 6: return this.IPSR;
      case 8: return this.spsel ? this.otherSP : this.r[13];
      case 9: return this.spsel ? this.r[13] : this.otherSP;
      case 10: return this.msplim;
      case 11: return this.psplim;
      case 16: return this.PM;
      case 17: case 18: return this.basepri;
      case 19: return this.FM;
      case 20: return (this.spsel ? 2 : 0) | (this.control & 1) | this.st[8];
    }
    return 0;
  }
  msr(n, value) {
    switch (n) {
      case 0: case 1: case 2: case 3: this.apsr = value; break;
      case 8: if (this.spsel) this.otherSP = value & ~3; else this.r[13] = value & ~3; break;
      case 9: if (this.spsel) this.r[13] = value & ~3; else this.otherSP = value & ~3; break;
      case 10: this.msplim = value; this.limitStack(); break;
      case 11: this.psplim = value; this.limitStack(); break;
      case 16: this.mask(value & 1); this.check(); break;
      case 17: this.basepri = value & 0xf0; this.check(); break;
      case 18: if (value & 0xf0 && (!this.basepri || (value & 0xf0) < this.basepri)) this.basepri = value & 0xf0; break;
      case 19: this.FM = value & 1; this.check(); break;
      case 20:
        this.control = value & 1;
        this.st[8] = value & 4;
        if (!this.handlerMode) this.useStack(value & 2 ? 1 : 0);
        break;
    }
  }
  tt() {
    return 0x00c00000 | (3 << 18); // secure, readable and writable
  }

  // ------------------------------------------------------------------ arithmetic that is too long to write in line

  ssat(x, bits) {
    const max = 2 ** (bits - 1) - 1;
    if (x > max) { this.st[5] = 1; return max; }
    if (x < -max - 1) { this.st[5] = 1; return -max - 1; }
    return x;
  }
  usat(x, bits) {
    const max = 2 ** bits - 1;
    if (x > max) { this.st[5] = 1; return max | 0; }
    if (x < 0) { this.st[5] = 1; return 0; }
    return x;
  }
  /** Saturate both halves of a word. */
  both(x, saturate, bits) {
    return (saturate.call(this, x << 16 >> 16, bits) & 0xffff) | (saturate.call(this, x >> 16, bits) << 16);
  }
  rbit(x) {
    x = ((x & 0x55555555) << 1) | ((x >>> 1) & 0x55555555);
    x = ((x & 0x33333333) << 2) | ((x >>> 2) & 0x33333333);
    x = ((x & 0x0f0f0f0f) << 4) | ((x >>> 4) & 0x0f0f0f0f);
    x = ((x & 0x00ff00ff) << 8) | ((x >>> 8) & 0x00ff00ff);
    return (x << 16) | (x >>> 16);
  }
  split(product) {
    this.st[7] = Number(BigInt.asIntN(32, product >> 32n));
    return Number(BigInt.asIntN(32, product));
  }
  umull(a, b) {
    // in halves of 16 bits
    const al = a & 0xffff, ah = a >>> 16, bl = b & 0xffff, bh = b >>> 16;
    const ll = al * bl, lh = al * bh, hl = ah * bl;
    const mid = (ll >>> 16) + (lh & 0xffff) + (hl & 0xffff);
    this.st[7] = (ah * bh + Math.floor(lh / 65536) + Math.floor(hl / 65536) + Math.floor(mid / 65536)) | 0;
    return (ll & 0xffff) | (mid << 16);
  }
  smull(a, b) {
    const low = this.umull(a, b);
    if (a < 0) this.st[7] -= b;
    if (b < 0) this.st[7] -= a;
    return low;
  }
  add64(low, l, h) {
    const sum = (low >>> 0) + (l >>> 0);
    this.st[7] = (this.st[7] + h + (sum > 0xffffffff ? 1 : 0)) | 0;
    return sum | 0;
  }
  /** Add a whole number of 34 bits or less to h:l. */
  accumulate(x, l, h) {
    this.st[7] = Math.floor(x / 2 ** 32);
    return this.add64(x | 0, l, h);
  }
  umlal(a, b, l, h) { return this.add64(this.umull(a, b), l, h); }
  smlal(a, b, l, h) { return this.add64(this.smull(a, b), l, h); }
  umaal(a, b, l, h) {
    const low = this.add64(this.umull(a, b), l, 0);
    return this.add64(low, h, 0);
  }
  mulWide(a, b) { return Number(BigInt.asIntN(32, (BigInt(a) * BigInt(b)) >> 16n)); }
  mulTop(a, b, c, round, subtract) {
    const product = BigInt(a) * BigInt(b);
    let x = (BigInt(c) << 32n) + (subtract ? -product : product);
    if (round) x += 0x80000000n;
    return Number(BigInt.asIntN(32, x >> 32n));
  }
  usad(a, b, c) {
    for (let i = 0; i < 32; i += 8) c += Math.abs(((a >>> i) & 255) - ((b >>> i) & 255));
    return c | 0;
  }
  addHalves(a, b) { return (((a & 0xffff) + (b & 0xffff)) & 0xffff) | (((a >>> 16) + (b >>> 16)) << 16); }
  qadd(kind, n, m) {
    const sat = (x) => {
      const y = Math.max(-0x80000000, Math.min(0x7fffffff, x));
      if (y !== x) this.st[5] = 1;
      return y;
    };
    if (kind === 0) return sat(m + n);
    if (kind === 1) return sat(m + sat(2 * n));
    if (kind === 2) return sat(m - n);
    return sat(m - sat(2 * n));
  }
  sel(n, m) {
    let x = 0;
    for (let i = 0; i < 4; i++) x |= ((this.ge >> i) & 1 ? n : m) & (255 << (8 * i));
    return x;
  }
  parallel(op, kind, n, m) {
    // op 0 ADD8, 1 ADD16, 2 ASX, 4 SUB8, 5 SUB16, 6 SAX; kind 0 S, 1 Q, 2 SH, 4 U, 5 UQ, 6 UH
    const unsigned = kind >= 4;
    const bits = op === 0 || op === 4 ? 8 : 16;
    const lane = (x, i) => (unsigned ? (x >>> (bits * i)) & (2 ** bits - 1) : (x << (32 - bits * (i + 1))) >> (32 - bits));
    let result = 0;
    let ge = 0;
    const count = 32 / bits;
    for (let i = 0; i < count; i++) {
      const cross = op === 2 || op === 6;
      const minus = op === 4 || op === 5 || (op === 2 && i === 0) || (op === 6 && i === 1);
      const b = lane(m, cross ? 1 - i : i);
      let x = minus ? lane(n, i) - b : lane(n, i) + b;
      const good = unsigned && !minus ? x > 2 ** bits - 1 : x >= 0;
      if (good) ge |= (bits === 8 ? 1 : 3) << (bits === 8 ? i : 2 * i);
      if ((kind & 3) === 1) x = unsigned ? Math.max(0, Math.min(2 ** bits - 1, x)) : Math.max(-(2 ** (bits - 1)), Math.min(2 ** (bits - 1) - 1, x));
      else if ((kind & 3) === 2) x >>= 1;
      result |= (x & (2 ** bits - 1)) << (bits * i);
    }
    if ((kind & 3) === 0) this.ge = ge;
    return result;
  }

  // ------------------------------------------------------------------ floating point

  /** One rounding: the product is exact in a double; the sum is rounded to odd before the last rounding. */
  fma(a, b, c) {
    const p = a * b;
    const sum = p + c;
    const single = Math.fround(sum);
    if (!Number.isFinite(sum) || single === sum) return single;
    // the error of the sum decides ties
    const bv = sum - p;
    const error = p - (sum - bv) + (c - bv);
    if (error === 0) return single;
    return Math.fround(nudge(sum, error));
  }
  compare(a, b) {
    const flags = a === b ? 6 : a < b ? 8 : a > b ? 2 : 3;
    this.fpscr = (this.fpscr & 0x0fffffff) | (flags << 28);
  }
  maxnm(a, b) { return Number.isNaN(a) ? b : Number.isNaN(b) ? a : Math.max(a, b); }
  minnm(a, b) { return Number.isNaN(a) ? b : Number.isNaN(b) ? a : Math.min(a, b); }
  /** mode 0: ties to even, 1: ties away, 2: up, 3: down, 4: to zero, 5: FPSCR */
  rint(x, mode) {
    if (!Number.isFinite(x) || x === 0) return x;
    return Math.abs(this.rounded(x, mode)) * (x < 0 ? -1 : 1);
  }
  rounded(x, mode) {
    switch (mode === 5 ? [0, 2, 3, 4][(this.fpscr >> 22) & 3] : mode) {
      case 1: return x < 0 ? -Math.floor(-x + 0.5) : Math.floor(x + 0.5);
      case 2: return Math.ceil(x);
      case 3: return Math.floor(x);
      case 4: return Math.trunc(x);
    }
    const down = Math.floor(x);
    const rest = x - down;
    return rest < 0.5 ? down : rest > 0.5 ? down + 1 : down % 2 ? down + 1 : down;
  }
  toInt(x, signed) {
    if (Number.isNaN(x)) return 0;
    x = Math.trunc(x);
    if (signed) return x > 0x7fffffff ? 0x7fffffff : x < -0x80000000 ? -0x80000000 : x | 0;
    return x > 0xffffffff ? -1 : x < 0 ? 0 : x | 0;
  }
  fixed(d, kind, size, bits) {
    const { s, si } = this;
    const unsigned = kind & 1;
    if (kind < 12) {
      let x = si[d];
      if (size === 16) x = unsigned ? x & 0xffff : (x << 16) >> 16;
      else if (unsigned) x >>>= 0;
      s[d] = x / 2 ** bits;
    } else {
      let x = Math.trunc(s[d] * 2 ** bits);
      const low = unsigned ? 0 : -(2 ** (size - 1));
      const high = unsigned ? 2 ** size - 1 : 2 ** (size - 1) - 1;
      x = Number.isNaN(x) ? 0 : Math.max(low, Math.min(high, x));
      si[d] = x | 0;
    }
  }
  halfConvert() {
    this.halt('half-precision floats are not emulated');
  }

  // ------------------------------------------------------------------ coprocessors

  mcrr(cp, op, crm, low, high, k) {
    if (cp >> 1 === 2) return this.dcp.write(op, crm, low, high);
    if (cp !== 0) return this.halt(`mcrr p${cp} #${op} c${crm}`);
    // GPIO: op 0 put, 1 xor, 2 set, 3 clear on all pins; 4 to 7 the same on one pin; c0 OUT, c4 OE
    this.sync(k);
    const oe = crm === 4;
    if (op >= 4) {
      const bit = low < 32 ? 1 << low : 0;
      if (op === 4) this.chip.sio.coprocessor(oe, high & 1 ? 2 : 3, bit);
      else if (high & 1) this.chip.sio.coprocessor(oe, op - 4, bit);
    } else this.chip.sio.coprocessor(oe, op, low);
    this.after();
  }
  mrrc(cp, op, crm, other, k) {
    if (cp >> 1 === 2) {
      const [low, high] = this.dcp.readPair(op, crm, other);
      this.st[7] = high;
      return low;
    }
    if (cp !== 0) {
      this.halt(`mrrc p${cp} #${op} c${crm}`);
      return 0;
    }
    this.sync(k);
    this.st[7] = 0;
    return this.chip.sio.readUint32(crm === 8 ? 0x04 : crm === 4 ? 0x30 : 0x10) | 0;
  }
  mcr(cp, op1, crn, crm, op2, value, k) {
    if (cp !== 0) return this.halt(`mcr p${cp} #${op1} c${crn} c${crm} #${op2}`);
    this.sync(k);
    if (op1 < 4) this.chip.sio.coprocessor(crn === 0 && crm === 4, op1, value);
    else if (op1 >= 5) this.chip.sio.coprocessor(crm === 4, op1 - 4, value < 32 ? 1 << value : 0);
    this.after();
  }
  mrc(cp, op1, crn, crm, op2, other) {
    if (cp >> 1 === 2) return this.dcp.readWord(crm, op2, other);
    if (cp === 0) return this.chip.sio.readUint32(crm === 8 ? 0x04 : crm === 4 ? 0x30 : 0x10) | 0;
    this.halt(`mrc p${cp} #${op1} c${crn} c${crm} #${op2}`);
    return 0;
  }
  cdp(cp, op1, crn, crm, op2) {
    if (cp >> 1 === 2) return this.dcp.step(op1, crm, op2);
    this.halt(`cdp p${cp} #${op1} c${crn} c${crm} #${op2}`);
  }
}

const f64 = new Float64Array(1);
const u64 = new BigInt64Array(f64.buffer);

/** The double next to x in the direction of the error if x is even in its last place, so that no tie is left. */
function nudge(x, error) {
  f64[0] = x;
  if (u64[0] & 1n) return x;
  u64[0] += (x > 0) === (error > 0) ? 1n : -1n;
  return f64[0];
}
