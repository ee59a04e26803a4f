// A bar with a motor's position between its limits: those in axes.toml, else its soft limits on the device.

import { h, setText } from "./dom.js";

const WHOLE = 100; // percent

export class PositionBar {
  #mark = h("span", { class: "mark" });
  #low = h("span");
  #high = h("span");
  element = h("div", { class: "range", hidden: true }, h("div", { class: "bar", "aria-hidden": "true" }, this.#mark), h("div", { class: "row spread faint" }, this.#low, this.#high));

  /** Show steps, or undefined, between the axis's limits or else `soft`, [lowest, highest] step; null: neither has any. */
  show(axis, soft, steps) {
    const ends = axis.limits ?? soft;
    this.element.hidden = !ends;
    if (!ends) return;
    const [left, right] = axis.perUnit < 0 ? [...ends].reverse() : ends;
    const share = right === left ? 0 : (steps - left) / (right - left);
    this.#mark.hidden = steps === undefined;
    this.#mark.style.left = `${Math.min(Math.max(share, 0), 1) * WHOLE}%`;
    this.element.classList.toggle("beyond", share < 0 || share > 1);
    for (const [text, end] of [[this.#low, left], [this.#high, right]]) setText(text, axis.withUnit(axis.short(axis.position(end))));
  }
}
