// A scope: levels of pins over the last moments of the board's time.

import { fitCanvas, h, setText } from "framestep-console/dom.js";

const ROW = 22; // pixels
const HIGH = 4; // from the row's top to a high level
const LOW = 18;
const LABEL = 128; // pixels left of the traces
const SHARE_BEFORE = 0.25; // part of the width before the trigger
const MS = 1e6; // ns
const SPANS = [[1000 * MS, "1 s"], [100 * MS, "100 ms"], [10 * MS, "10 ms"], [1 * MS, "1 ms"]];
const SPEED_MS = 2000; // interval in which the board's speed is measured

export class Scope {
  #pins;
  #rows; // [pin, name]
  #canvas = h("canvas", { class: "scope", role: "img", "aria-label": "Levels of the pins over time" });
  #span = h("select", { "aria-label": "Time across" }, ...SPANS.map(([value, text]) => h("option", { value: String(value) }, text)));
  #trigger = h("select", { "aria-label": "Trigger" }, h("option", { value: "" }, "none"));
  #hold = h("input", { type: "checkbox", onchange: () => this.#freeze() });
  #speed = h("p", { class: "faint", role: "status" });
  #began = null; // {real, nanos}: start of the measurement of speed
  #frozen = null; // end of the frozen picture

  constructor(pins, rows) {
    this.#pins = pins;
    this.#rows = rows;
    this.#span.value = String(100 * MS);
    this.#trigger.append(...rows.map(([pin, name]) => h("option", { value: String(pin) }, name)));
    this.#canvas.style.height = `${ROW * rows.length}px`;
    this.element = h("article", { class: "card", "aria-label": "Pins" },
      h("div", { class: "row spread" }, h("h3", {}, "Pins"),
        h("div", { class: "row" }, h("label", {}, "Across ", this.#span), h("label", {}, "Rising edge of ", this.#trigger), h("label", { class: "check" }, this.#hold, "Hold"))),
      this.#canvas, this.#speed);
  }

  draw() {
    this.#measureSpeed();
    const place = fitCanvas(this.#canvas);
    if (!place) return;
    const { context, width } = place;
    const span = Number(this.#span.value);
    const start = this.#start(span);
    const style = getComputedStyle(this.#canvas);
    context.font = "12px system-ui, sans-serif";
    context.textBaseline = "middle";
    for (const [i, [pin, name]] of this.#rows.entries()) {
      context.fillStyle = style.color;
      context.fillText(name, 0, i * ROW + ROW / 2);
      context.fillStyle = style.outlineColor;
      this.#drawRow(context, this.#pins.edges[pin], i * ROW, width - LABEL, start, span);
    }
  }

  /** Draw a row; a column of pixels is a level, an edge, or several edges. */
  #drawRow(context, edges, top, columns, start, span) {
    let before = edges.upTo(start);
    let runFrom = 0;
    const run = (to) => { // of columns at one level
      if (to > runFrom) context.fillRect(LABEL + runFrom, top + (edges.level(before - 1) ? HIGH : LOW), to - runFrom, 1);
    };
    for (let x = 0; x < columns; x += 1) {
      const after = edges.upTo(start + ((x + 1) * span) / columns, before);
      if (after === before) continue;
      run(x);
      context.fillRect(LABEL + x, top + HIGH, 1, LOW - HIGH + 1);
      before = after;
      runFrom = x + 1;
    }
    run(columns);
  }

  /** Return the start of the picture: it ends now, or has the trigger's last edge at its place. */
  #start(span) {
    const end = this.#frozen ?? this.#pins.nanos;
    if (!this.#trigger.value) return end - span;
    const edges = this.#pins.edges[Number(this.#trigger.value)];
    const last = edges.upTo(end - (1 - SHARE_BEFORE) * span) - 1;
    const rising = edges.level(last) ? last : last - 1;
    return rising < 0 ? end - span : edges.time(rising) - SHARE_BEFORE * span;
  }

  #freeze() {
    this.#frozen = this.#hold.checked ? this.#pins.nanos : null;
  }

  #measureSpeed() {
    const now = { real: performance.now(), nanos: this.#pins.nanos };
    this.#began ??= now;
    const passed = now.real - this.#began.real;
    if (passed < SPEED_MS) return;
    const speed = (now.nanos - this.#began.nanos) / MS / passed;
    setText(this.#speed, `The board's time goes at ${speed.toFixed(2)} of real time${speed < 0.95 ? ": this computer is too slow or too busy" : ""}.`);
    this.#began = now;
  }
}
