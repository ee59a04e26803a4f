// The board's load: measured once, or live while something runs.

import { check, h, s, setText } from "./dom.js";

const EVERY_MS = 1000;
const KEPT = 60; // points of the drawing
const WIDTH = 600;
const HEIGHT = 80;
const TICK_US = 1000;

export class LoadCard {
  #ask;
  #tell;
  #said = h("pre", { role: "status" });
  #live = h("input", { onchange: () => this.#turn() });
  #drawing = s("svg", { class: "drawing", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "Interrupts in the last minute" });
  #shares = [];
  #before = null; // the counts of the last answer
  #timer = 0;
  #round = 0;

  /** ask(task): runs a task on the REPL, by the server or the page; tell(text): shows a mistake. */
  constructor(ask, tell, button) {
    this.#ask = ask;
    this.#tell = tell;
    this.#drawing.style.display = "none";
    this.element = h("article", { class: "card", "aria-label": "Load of the board" },
      h("h3", {}, "The board's load"),
      h("div", { class: "row" }, button("Measure", () => this.#measure()), check("Live, each second", this.#live)),
      this.#said, this.#drawing);
    document.addEventListener("visibilitychange", () => document.hidden && this.stop());
  }

  set disabled(on) {
    this.#live.disabled = on;
  }

  /** Stop watching: the link is gone, or the view is hidden. */
  stop() {
    if (!this.#live.checked) return;
    this.#live.checked = false;
    this.#turn();
  }

  async #measure() {
    this.stop();
    setText(this.#said, (await this.#ask("load")).lines.join("\n"));
  }

  #turn() {
    clearTimeout(this.#timer);
    this.#round += 1;
    this.#drawing.style.display = this.#live.checked ? "" : "none";
    this.#shares = [];
    this.#before = null;
    if (this.#live.checked) this.#look(this.#round);
    else this.#ask("rest").catch(() => {}); // closes the port
  }

  async #look(round) {
    try {
      const { figures } = await this.#ask("live");
      if (round !== this.#round) return;
      this.#show(figures);
      this.#timer = setTimeout(() => this.#look(round), EVERY_MS);
    } catch (error) {
      if (round !== this.#round) return;
      this.#tell(error.message);
      this.stop();
    }
  }

  /** Percent of the time since the last answer that ticks and passes took; counts are modulo 2^30. */
  #busy(counts) {
    const before = this.#before;
    this.#before = counts;
    if (!before) return "";
    const [ms, ticks, passes] = counts.map((count, i) => (count - before[i]) & 0x3fffffff);
    if (ms === 0 || passes === 0 || ticks + passes > 1000 * ms) return ""; // not measured, or the counts were reset meanwhile
    return `Last second: ${(ticks / ms / 10).toFixed(0)} % ticks, ${(passes / ms / 10).toFixed(0)} % passes of the main loop`;
  }

  #show([mean, longest, latest, limit, holds, queues, ...counts]) {
    this.#shares.push(mean);
    if (this.#shares.length > KEPT) this.#shares.shift();
    const filled = queues.map(([motor, waiting]) => `motor ${motor} ${waiting}`).join(", ");
    setText(this.#said, [
      `Interrupts: ${mean} µs of each ${TICK_US}, ${longest} µs at a time at most`,
      `Worst lateness of a tick in motion: ${latest} µs, the limit is ${limit} µs`,
      queues.length ? `Segments that wait, of ${holds}: ${filled}` : "No motor moves.",
      this.#busy(counts),
    ].filter(Boolean).join("\n"));
    const points = this.#shares.map((share, i) => `${((i * WIDTH) / (KEPT - 1)).toFixed(1)},${(HEIGHT * (1 - Math.min(share / TICK_US, 1))).toFixed(1)}`);
    this.#drawing.replaceChildren(
      s("polyline", { fill: "none", stroke: "#2f7fb8", "stroke-width": 2, points: points.join(" ") }),
      s("text", { x: 6, y: 14 }, "interrupts, to 100 % of the processor's time"));
  }
}
