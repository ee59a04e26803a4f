// A chain of 74HC595 at four pins: each output is a pin of its own for the trace, with numbers from
// `first` on. A register takes its data at a rising clock and shows what it has at a rising latch.
// Its outputs count as low while the enable input (active low, with a pull-up) is high. At power-up
// it has random levels; a reset of the chip alone changes nothing in it.

export const BITS = 32;

export class ShiftRegisters {
  /** @param pins {data, clock, latch, enable, first} */
  constructor(board, pins) {
    this.board = board;
    this.pins = pins;
    this.powerUp(1);
  }

  powerUp(seed) {
    this.shifted = (seed * 0x9e3779b1) >>> 0;
    this.latched = ~this.shifted >>> 0;
    this.shown = 0;
  }

  get outputs() {
    const enable = this.board.chip.gpio[this.pins.enable];
    return enable.driven && !enable.level ? this.latched : 0;
  }

  /** A pin of the chip has changed. */
  edge(pin, level) {
    const { data, clock, latch, enable } = this.pins;
    if (pin === clock && level) this.shifted = ((this.shifted << 1) | ((this.board.levels >>> data) & 1)) >>> 0;
    else if (pin === latch && level) {
      this.latched = this.shifted;
      this.show();
    } else if (pin === enable) {
      this.show();
    }
  }

  /** Show a word at a moment, which may be ahead. */
  latch(word, nanos) {
    this.shifted = this.latched = word >>> 0;
    this.show(nanos);
  }

  show(nanos = this.board.clock.nanos) {
    const { outputs } = this;
    let changed = (outputs ^ this.shown) >>> 0;
    this.shown = outputs;
    const { trace } = this.board;
    while (changed && trace) {
      const bit = 31 - Math.clz32(changed);
      changed = (changed & ~(1 << bit)) >>> 0;
      trace.add(nanos, this.pins.first + bit, (outputs >>> bit) & 1);
    }
  }

  level(pin) {
    return (this.outputs >>> (pin - this.pins.first)) & 1;
  }

  /** Whether nobody sees the edges of its data, clock and latch, as long as its outputs are right. */
  get unseen() {
    const { pins } = this;
    const { trace } = this.board;
    return !trace || !(trace.wanted[pins.data] || trace.wanted[pins.clock] || trace.wanted[pins.latch]);
  }
}
