// A bar for a motor: its limits, what the move uses of them, where the rig is and where the preview is.

import { h, setText } from "./dom.js";

const WHOLE = 100; // percent
const SPARE = 0.05; // of the move's range beside it, where there are no limits

export class MotorBar {
  #band = h("div", { class: "band" });
  #see = h("div", { class: "see" });
  #now = h("div", { class: "now" });
  #low = h("span");
  #high = h("span");
  element;
  #ends = null;

  constructor(color) {
    this.#band.style.background = color;
    this.element = h("div", { class: "bar" }, h("div", { class: "track", "aria-hidden": "true" }, this.#band, this.#see, this.#now), h("div", { class: "ends" }, this.#low, this.#high));
  }

  /** axis: the motor's; soft: [lowest, highest] step on the board, or null; used: those of the move, or null; now, see: steps of
   * the rig and the preview, or undefined. */
  show(axis, soft, used, now, see) {
    const limits = axis.limits ?? soft;
    const spare = used ? Math.max(1, (used[1] - used[0]) * SPARE) : 0;
    const ends = limits ?? (used && [used[0] - spare, used[1] + spare]);
    this.element.style.visibility = ends ? "" : "hidden";
    if (!ends) return;
    this.#ends = axis.perUnit < 0 ? [...ends].reverse() : ends;
    this.#put(this.#now, now);
    this.#put(this.#see, see);
    const band = used ? used.map((steps) => this.#share(steps)).sort((a, b) => a - b) : [0, 0];
    this.#band.hidden = !used;
    this.#band.style.left = `${band[0]}%`;
    this.#band.style.width = `${Math.max(band[1] - band[0], 1)}%`;
    for (const [text, end] of [[this.#low, this.#ends[0]], [this.#high, this.#ends[1]]]) setText(text, limits ? axis.withUnit(axis.brief(end)) : "");
    this.element.classList.toggle("beyond", now !== undefined && (now < Math.min(...ends) || now > Math.max(...ends)));
  }

  #share(steps) {
    const [left, right] = this.#ends;
    return Math.min(Math.max(right === left ? 0 : (steps - left) / (right - left), 0), 1) * WHOLE;
  }

  #put(mark, steps) {
    mark.hidden = steps === undefined;
    if (steps !== undefined) mark.style.left = `${this.#share(steps)}%`;
  }
}
