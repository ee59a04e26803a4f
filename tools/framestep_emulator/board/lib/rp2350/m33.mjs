// A Cortex-M33 of an RP2350, secure state only, with the interface that the board and the peripherals expect of
// core.mjs. Code runs as WebAssembly made of emit.mjs' text, a piece at a time; interrupts are taken between its instructions.

import { Processor } from '../processor.mjs';
import { Dcp } from './dcp.mjs';
import { RAM_SIZE, SCRATCH, STATE } from './emit.mjs';
import { STEP } from './native.mjs';

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
const PLACES = 64; // of a piece, at most
const WAIT_EVENT = 1;
const WAIT_INTERRUPT = 2;

export class M33 extends Processor {
  // No part of the chip's state
  #native;
  #running = false; // code
  #fault = null; // in it

  /** @param options.native a Native2350, to which the chip is attached */
  constructor(chip, { xipMiss = 0, onHalt = () => {}, native } = {}) {
    super(chip, { registers: native.registers, state: native.state, exceptions: 80, onHalt });
    this.#native = native;
    this.si = native.floats;
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

    this.FM = 0;
    this.basepri = 0;
    this.control = 0;
    this.msplim = this.psplim = 0;
    this.enabled = new Int32Array(2);
    this.pending = new Int32Array(2);
    this.active = new Set();
    this.priorities = new Uint8Array(64);
    this.shpr = new Uint8Array(16);
    this.cpacr = 0;
    this.ppbWords = new Map();
    this.systick = { ctrl: 0, reload: 0, base: 0, alarm: chip.clock.createAlarm(() => this.systickFires()) };
    this.cycleNanos = 1e9 / 150e6;

    this.xipMiss = xipMiss;
    this.xipTags = native.xipTags;
    this.xipOld = native.xipOld;
    this.xipLast = -1; // line that was read last, and when that was done
    this.xipEnd = 0;
    this.xipMisses = 0;

    // Where code goes on in the middle of a piece: its start * PLACES + number of the instruction; 0: nowhere
    this.next = [0, 0]; // address and place after the last stretch
    this.stopped = new Map(); // by address: where a piece has ended at the limit and may go on after an exception
  }

  // ------------------------------------------------------------------ running

  /** Run pieces that end before the limit, and of the last one the instructions that begin before it. */
  execute() {
    const { st, r } = this;
    const native = this.#native;
    native.core = this; // another chip's may have run in between
    this.#running = true;
    let place = this.next[0] === r[15] ? this.next[1] : (this.stopped.get(r[15]) ?? 0);
    for (;;) {
      if (!place) {
        if (!native.run()) {
          place = this.stopped.get(r[15]) ?? 0;
          break;
        }
        if (st[STATE.cycles] >= st[STATE.limit]) break;
        place = r[15] * PLACES;
      } else if (st[STATE.cycles] >= st[STATE.limit]) break;
      place = this.#runFrom(place);
    }
    this.next[0] = r[15];
    this.next[1] = place;
    this.#running = false;
    if (this.#fault === null) return;
    const [reason, pc] = this.#fault;
    this.#fault = null;
    this.halt(reason, pc);
  }

  /** Run a piece from a place on, up to its end or to the limit. Returns where it goes on then. */
  #runFrom(from) {
    const { r } = this;
    const native = this.#native;
    const { scratch } = native;
    const place = from % PLACES;
    const start = (from - place) / PLACES;
    const at = native.stepOf(start, place);
    const { pc, cycles } = native.step(at);
    if (pc !== r[15]) return 0; // it is no longer that piece
    if (native.hasChanged(start)) {
      native.stale(start);
      return 0;
    }
    scratch[SCRATCH.stopping] = 1;
    scratch[SCRATCH.stop] = 0;
    this.cyc -= cycles;
    r[15] = start; // as for a piece that runs from its start
    r[15] = native.steps(at);
    const stop = scratch[SCRATCH.stop];
    if (!stop) return 0;
    const goesOn = from + (stop - at) / STEP;
    this.stopped.set(r[15], goesOn);
    return goesOn;
  }

  /** Called by running code: the list of the piece at an address for which there is none in flash and RAM, or 0 where no code is to run. */
  find(pc) {
    if (pc >>> 24 === 0xff) this.exceptionReturn(pc);
    else if (this.#native.canRun(pc)) return this.#native.listOf(pc);
    else this.halt('instruction fetch outside the memory', pc);
    return 0;
  }

  /** The board stops once the piece has ended. */
  halt(reason, pc) {
    this.limit = -1;
    if (!this.#running) super.halt(reason, pc);
    else this.#fault ??= pc === undefined ? [`${reason}, in the piece at pc`, this.r[15]] : [reason, pc];
  }

  undefined(pc, h, g) {
    this.halt(`undefined instruction ${h.toString(16)}${g < 0 ? '' : ` ${g.toString(16)}`}`, pc);
    return pc;
  }

  /** @param k cycles of the piece up to it, which tell the instruction */
  fault(reason, k) {
    this.halt(`fault: ${reason}`, k && this.#running ? this.#native.instructionAt(this.r[15], k) : undefined);
    return 0;
  }

  bkpt(n, pc) {
    if (pc >>> 0 < ROM_SIZE && this.romCall) return this.romCall(n);
    this.r[15] = pc;
    this.halt(`breakpoint #${n}`, pc);
  }

  // ------------------------------------------------------------------ memory

  /** The time after some more cycles, in ns. */
  at(extra) {
    return this.sliceStart + (this.cyc + extra) * this.cycleNanos;
  }
  /** Before touching a peripheral: what is due happens first. */
  sync(extra) {
    const { clock } = this;
    const now = this.at(extra);
    if (clock.nextNanos <= now) clock.fireUntil(now);
    else if (now > clock.nanosCounter) clock.nanosCounter = now;
  }
  xipLine(line) {
    const { xipTags, xipOld } = this;
    if (!this.xipMiss) return this.#native.replaced(-1, line, 1);
    const set = line & (XIP_SETS - 1);
    const { qmi } = this.chip;
    const begin = this.cycles;
    this.cyc += line === this.xipLast + 1 && begin - this.xipEnd <= qmi.cooldown ? qmi.next : qmi.first;
    this.xipLast = line;
    this.xipEnd = this.cycles;
    this.xipMisses++;
    const half = xipOld[set] === 1 ? 2 : 1;
    const place = half === 2 ? set + XIP_SETS : set;
    this.#native.replaced(xipTags[place], line, half);
    xipTags[place] = line;
    xipOld[set] = half;
  }
  xipFlush() {
    this.xipLast = -1;
    this.xipTags.fill(-1);
    this.#native.flushed();
  }
  touch(offset) {
    if (!this.xipMiss) return;
    const line = offset >>> 3;
    const half = this.#native.xipPresent[line];
    if (half) this.xipOld[line & (XIP_SETS - 1)] = half;
    else this.xipLine(line);
  }

  /** k: cycles of the piece up to here, which are not counted yet. */
  ld32(a, k) {
    const top = a >>> 24;
    if (a & 3) {
      if (top !== 0x20 && (top < 0x10 || top >= 0x14) && a >>> 0 >= ROM_SIZE) return this.fault(`unaligned read of ${(a >>> 0).toString(16)}`, k);
      this.cyc += 1;
      return this.ld8(a, k) | (this.ld8(a + 1, k) << 8) | (this.ld8(a + 2, k) << 16) | (this.ld8(a + 3, k) << 24);
    }
    if (top === 0x20 && (a & 0xffffff) < RAM_SIZE) return this.ram32[(a & 0xffffff) >> 2];
    if (top >= 0x10 && top < 0x18) {
      if (top === 0x10) this.touch(a & this.flashMask);
      return this.flash32[(a & this.flashMask) >> 2];
    }
    if (a >>> 0 < ROM_SIZE) return this.rom32[a >> 2];
    if ((a & 0xfffff000) === DPRAM_BASE) return this.dpram32[(a & 0xfff) >> 2];
    this.sync(k);
    if (top === 0xd0) {
      const value = this.chip.sio.readUint32(a & 0xffff);
      this.afterAccess();
      return value;
    }
    if (top === 0xe0) return this.ppbRead(a & 0xfffff, k);
    if (top === 0x40) this.cyc += APB_EXTRA;
    else if (top !== 0x50) return this.fault(`read of ${(a >>> 0).toString(16)}`, k);
    const value = this.chip.readPeripheral(a >>> 0);
    this.afterAccess();
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
      if (top !== 0x20) return void this.fault(`unaligned write of ${(a >>> 0).toString(16)}`, k);
      this.cyc += 1;
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
        this.afterAccess();
      }
      return;
    }
    if (top >= 0x10 && top < 0x20) return; // cache maintenance
    if (a >>> 0 < ROM_SIZE) return;
    this.sync(k);
    if (top === 0xd0) this.chip.sio.writeUint32(a & 0xffff, value >>> 0);
    else if (top === 0xe0) this.ppbWrite(a & 0xfffff, value >>> 0, k);
    else if (top === 0x40 || top === 0x50) {
      if (top === 0x40) this.cyc += APB_EXTRA;
      this.chip.writePeripheral(a >>> 0, value >>> 0);
    } else return void this.fault(`write of ${(a >>> 0).toString(16)}`, k);
    this.afterAccess();
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
        const ticks = Math.floor((this.at(k) - base) / (ctrl & 4 ? this.cycleNanos : 1000));
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
          this.systick.base = this.at(k);
          this.systickArm();
          return;
        case 0xe014: this.systick.reload = value & 0xffffff; return;
        case 0xe018:
          this.systick.base = this.at(k);
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
      this.pending[word] &= ~bit; // as core.mjs; the peripherals hold their lines
      return;
    }
    if (this.pending[word] & bit) return;
    this.pending[word] |= bit;
    if (this.SCR & 0x10) this.sev();
    if (this.enabled[word] & bit) this.check();
  }
  check() {
    this.irqCheck = true;
    this.limit = -1;
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
    super.useStack(which);
    this.limitStack();
  }
  limitStack() {
    this.st[STATE.floor] = this.spsel ? this.psplim : this.msplim;
  }
  overflow() {
    this.fault(`the stack pointer is below its limit ${(this.st[STATE.floor] >>> 0).toString(16)}`);
  }
  get apsr() {
    return this.nzcv | (this.st[STATE.sticky] ? 0x08000000 : 0) | (this.st[STATE.ge] << 16);
  }
  set apsr(value) {
    this.nzcv = value;
    this.st[STATE.sticky] = (value >>> 27) & 1;
    this.st[STATE.ge] = (value >>> 16) & 15;
  }
  exceptionEntry(n) {
    const { r, st, si } = this;
    this.entered(n);
    const fp = st[STATE.fpca] && !(this.ppbWords.get(0xef34) === 0);
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
      put(0x60, st[STATE.fpscr]);
    }
    r[13] = frame;
    if (frame < st[STATE.floor]) this.overflow();
    r[14] = (this.handlerMode ? 0xfffffff1 : this.spsel ? 0xfffffffd : 0xfffffff9) & (fp ? ~0x10 : ~0);
    this.handlerMode = true;
    this.IPSR = n;
    this.active.add(n);
    this.useStack(0);
    st[STATE.fpca] = 0;
    st[STATE.monitor] = 0;
    this.waiting = 0;
    this.eventRegistered = true;
    r[15] = this.ld32((this.VTOR + 4 * n) | 0, 0) & ~1;
    st[STATE.cycles] += ENTRY_CYCLES;
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
      st[STATE.fpscr] = get(0x60);
    }
    r[13] = ((frame + (fp ? 0x68 : 0x20)) | 0) | (psr & 0x200 ? 4 : 0);
    this.apsr = psr;
    this.IPSR = this.handlerMode ? psr & 0x1ff : 0;
    st[STATE.fpca] = fp ? 4 : 0;
    st[STATE.monitor] = 0;
    st[STATE.cycles] += RETURN_CYCLES;
    this.eventRegistered = true;
    this.irqCheck = true;
    st[STATE.limit] = -1;
    this.returned();
  }

  svc() {
    this.pendingSVCall = true;
    this.check();
  }
  cps(disable, which) {
    if (which & 2) this.mask(!!disable);
    if (which & 1) this.FM = disable;
    if (!disable) this.check();
  }
  wfe() {
    if (this.eventRegistered) this.eventRegistered = false;
    else {
      this.waiting = WAIT_EVENT;
      this.limit = -1;
      this.wake();
    }
  }
  wfi() {
    this.waiting = WAIT_INTERRUPT;
    this.limit = -1;
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
      case 16: return this.PM ? 1 : 0;
      case 17: case 18: return this.basepri;
      case 19: return this.FM;
      case 20: return (this.spsel ? 2 : 0) | (this.control & 1) | this.st[STATE.fpca];
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
      case 16: this.mask(!!(value & 1)); this.check(); break;
      case 17: this.basepri = value & 0xf0; this.check(); break;
      case 18: if (value & 0xf0 && (!this.basepri || (value & 0xf0) < this.basepri)) this.basepri = value & 0xf0; break;
      case 19: this.FM = value & 1; this.check(); break;
      case 20:
        this.control = value & 1;
        this.st[STATE.fpca] = value & 4;
        if (!this.handlerMode) this.useStack(value & 2 ? 1 : 0);
        break;
    }
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
    this.afterAccess();
  }
  mrrc(cp, op, crm, other, k) {
    if (cp >> 1 === 2) {
      const [low, high] = this.dcp.readPair(op, crm, other);
      this.st[STATE.high] = high;
      return low;
    }
    if (cp !== 0) {
      this.halt(`mrrc p${cp} #${op} c${crm}`);
      return 0;
    }
    this.sync(k);
    this.st[STATE.high] = 0;
    return this.chip.sio.readUint32(crm === 8 ? 0x04 : crm === 4 ? 0x30 : 0x10) | 0;
  }
  mcr(cp, op1, crn, crm, op2, value, k) {
    if (cp !== 0) return this.halt(`mcr p${cp} #${op1} c${crn} c${crm} #${op2}`);
    this.sync(k);
    if (op1 < 4) this.chip.sio.coprocessor(crn === 0 && crm === 4, op1, value);
    else if (op1 >= 5) this.chip.sio.coprocessor(crm === 4, op1 - 4, value < 32 ? 1 << value : 0);
    this.afterAccess();
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
