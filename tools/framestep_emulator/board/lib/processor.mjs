// What the processors of both chips have in common: stretches of time, halts, the two stacks, PRIMASK, and counts of exceptions.

const LONGEST = 0x3fffffff; // cycles of a stretch

export class Processor {
  /**
   * @param options.registers all 16, Int32Array
   * @param options.state of running code, Int32Array: cycles of the stretch, their limit, nz, c, v, and what else a class keeps there
   * @param options.exceptions how many there are
   * @param options.onHalt called with a reason when the processor locks up
   */
  constructor(chip, { registers, state, exceptions, onHalt }) {
    this.chip = this.rp2040 = chip;
    this.clock = chip.clock;
    this.onHalt = onHalt;
    this.r = registers;
    this.st = state;
    this.registers = new Uint32Array(registers.buffer, registers.byteOffset, 16);
    this.nz = 1;

    this.PM = false;
    this.maskedSince = 0; // cycles when PRIMASK was set
    this.flashBusy = false; // the flash was erased or written since then
    this.longestMasked = { cycles: 0, endNanos: 0 };
    this.spsel = 0;
    this.otherSP = 0; // the stack pointer not in use
    this.handlerMode = false;
    this.IPSR = 0;
    this.pendingSVCall = this.pendingPendSV = this.pendingSystick = false;
    this.VTOR = 0;
    this.SCR = 0;
    this.eventRegistered = false;
    this.waiting = 0;
    this.halted = false;

    // Time within the running stretch
    this.cycleNanos = 8;
    this.budget = 0;
    this.sliceStart = 0;
    this.sliceEnd = 0;
    this.irqCheck = false;
    this.totalCycles = 0; // executed, up to the start of the stretch
    this.stop = false; // end the running stretch
    this.romCall = null; // set by the boot ROM: services `bkpt #n` in the ROM

    // Cycles and calls per exception number
    this.excCount = new Float64Array(exceptions);
    this.excCycles = new Float64Array(exceptions);
    this.excMax = new Float64Array(exceptions);
    this.excStack = []; // number and first cycle of those that run
  }

  /** Cycles of the stretch. */
  get cyc() {
    return this.st[0];
  }
  set cyc(value) {
    this.st[0] = value;
  }

  /** No instruction begins after so many of them. */
  get limit() {
    return this.st[1];
  }
  set limit(value) {
    this.st[1] = value;
  }

  // Flags: N and Z come from `nz` read as a signed number, C and V are 0 or 1.
  get nz() {
    return this.st[2];
  }
  set nz(value) {
    this.st[2] = value;
  }
  get c() {
    return this.st[3];
  }
  get v() {
    return this.st[4];
  }

  /** The flags as the upper four bits of a program status register. */
  get nzcv() {
    const { nz, c, v } = this;
    return (nz < 0 ? 0x80000000 : 0) | (nz === 0 ? 0x40000000 : 0) | (c ? 0x20000000 : 0) | (v ? 0x10000000 : 0);
  }
  set nzcv(value) {
    this.st[2] = value & 0x80000000 ? -1 : value & 0x40000000 ? 0 : 1;
    this.st[3] = (value >>> 29) & 1;
    this.st[4] = (value >>> 28) & 1;
  }

  get cycles() {
    return this.totalCycles + this.cyc;
  }
  // rp2040js' SIO adds the divider's time here, but the firmware already waits for it
  set cycles(_value) {}

  get logger() {
    return this.chip.logger;
  }

  // ------------------------------------------------------------------ running

  /** Run until `endNanos` or until something ends the stretch: WFE, a halt, a new alarm. */
  run(endNanos) {
    this.sliceStart = this.clock.nanosCounter;
    this.sliceEnd = endNanos;
    this.cyc = 0;
    this.budget = Math.min(LONGEST, Math.max(1, Math.ceil((endNanos - this.sliceStart) / this.cycleNanos - 1e-6)));
    do {
      if (this.irqCheck) {
        this.irqCheck = false;
        this.takeInterrupt();
      }
      this.limit = this.budget;
      this.execute();
    } while (this.cyc < this.budget && !this.waiting && !this.halted && !this.stop);
    this.totalCycles += this.cyc;
    this.clock.nanosCounter = this.now;
    this.cyc = 0;
  }

  /** The time in the running stretch, in ns. */
  get now() {
    return this.sliceStart + this.cyc * this.cycleNanos;
  }

  /** After touching a peripheral: an alarm may now be due before the end of the stretch. */
  afterAccess() {
    const next = this.clock.nextNanos;
    if (next < this.sliceEnd) {
      this.sliceEnd = next;
      this.budget = Math.max(0, Math.ceil((next - this.sliceStart) / this.cycleNanos));
      if (this.limit > this.budget) this.limit = this.budget;
    }
  }

  /** End the stretch after the current instruction (chip reset, clock change). */
  leave() {
    this.stop = true;
    this.limit = -1;
  }

  halt(reason, pc = this.r[15]) {
    this.limit = -1;
    if (this.halted) return;
    this.halted = true;
    const hex = (n) => '0x' + (n >>> 0).toString(16);
    this.onHalt(`${reason} (pc ${hex(pc)}, lr ${hex(this.r[14])}, sp ${hex(this.r[13])}, ipsr ${this.IPSR})`);
  }

  // ------------------------------------------------------------------ exceptions

  useStack(which) {
    if (this.spsel !== which) {
      const sp = this.r[13];
      this.r[13] = this.otherSP;
      this.otherSP = sp;
      this.spsel = which;
    }
  }

  /** Set PRIMASK. Records the longest time that it is set, except during flash writes by the boot ROM. */
  mask(on) {
    if (on === this.PM) return;
    this.PM = on;
    if (on) {
      this.maskedSince = this.cycles;
      this.flashBusy = false;
      return;
    }
    const cycles = this.cycles - this.maskedSince;
    if (cycles > this.longestMasked.cycles && !this.flashBusy) this.longestMasked = { cycles, endNanos: this.now };
  }

  /** Count an exception that begins. */
  entered(n) {
    this.excStack.push(n, this.cycles);
    this.excCount[n]++;
  }

  /** The last one that began has ended. */
  returned() {
    const { excStack } = this;
    if (!excStack.length) return;
    const spent = this.cycles - excStack.pop();
    const n = excStack.pop();
    this.excCycles[n] += spent;
    if (spent > this.excMax[n]) this.excMax[n] = spent;
  }
}
