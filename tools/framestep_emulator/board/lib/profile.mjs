// Profile of the processor's cycles, by instruction address and by Python function.
//
// Python functions are followed by calls of MicroPython's own three entrances, whose addresses the client reads from
// the firmware's symbols. Each is called with the function object, or with a code state that begins with it. A call ends
// when the stack pointer is above its value at the call. Time in interrupts belongs to no function.

const HALVES = 1 << 22; // of the address space to which addresses are folded: flash, then RAM
const RAM_FOLD = 1 << 21;
const BYTECODE = 12; // of a function object: address of its code

const fold = (pc) => ((pc >>> 24 === 0x20 ? RAM_FOLD : 0) + ((pc & 0x1fffff) >> 1)) & (HALVES - 1);

export class Profile {
  /** @param entrances addresses whose r0 is a function; @param states addresses whose r0 is a code state */
  constructor(core, entrances, states) {
    this.core = core;
    this.entrances = new Set(entrances);
    this.states = new Set(states);
    this.spent = new Float64Array(HALVES);
    this.functions = new Map(); // address of the code -> [calls, own cycles, cycles including what it calls]
    this.stack = []; // of [code, stack pointer, cycles at entry]
    this.last = core.cycles;
    this.lastPc = 0;
    this.top = null;
  }

  /** Called before each instruction, with the cycles so far. */
  note(pc, cycles) {
    const { core } = this;
    const now = core.totalCycles + cycles;
    const took = now - this.last;
    this.last = now;
    this.spent[fold(this.lastPc)] += took;
    this.lastPc = pc;
    if (core.handlerMode) return;
    if (this.top) this.top[1] += took;
    const sp = core.r[13] >>> 0;
    while (this.stack.length && sp > this.stack[this.stack.length - 1][1]) {
      const [code, , begun] = this.stack.pop();
      const outer = this.stack.some((call) => call[0] === code);
      if (!outer) this.functions.get(code)[2] += now - begun;
      this.top = this.stack.length ? this.functions.get(this.stack[this.stack.length - 1][0]) : null;
    }
    let fun = 0;
    if (this.entrances.has(pc)) fun = core.r[0];
    else if (this.states.has(pc)) fun = core.load32(core.r[0]);
    if (!fun) return;
    const code = core.load32(fun + BYTECODE) >>> 0;
    if (!this.functions.has(code)) this.functions.set(code, [0, 0, 0]);
    this.top = this.functions.get(code);
    this.top[0]++;
    this.stack.push([code, sp, now]);
  }

  take() {
    const addresses = [];
    this.spent.forEach((cycles, i) => {
      if (cycles) addresses.push([i >= RAM_FOLD ? 0x20000000 + 2 * (i - RAM_FOLD) : 0x10000000 + 2 * i, cycles]);
    });
    return { addresses, functions: [...this.functions].map(([code, figures]) => [code, ...figures]) };
  }
}
