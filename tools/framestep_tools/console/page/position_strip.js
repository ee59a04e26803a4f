// All motors in one line: names, positions, bars between limits.

import { h, setText } from "./dom.js";
import { PositionBar } from "./position_bar.js";

export class PositionStrip {
  element = h("ul", { class: "strip", "aria-label": "Positions" });
  #device;
  #parts = [];

  constructor(device) {
    this.#device = device;
    device.axes.addEventListener("change", () => this.make());
  }

  /** Make an entry for each motor of the device. */
  make() {
    this.#parts = Array.from({ length: this.#device.motors }, (_, i) => {
      const axis = this.#device.axes.of(i + 1);
      const part = { axis, shown: h("output", { "aria-label": `${axis.title} now` }), bar: new PositionBar(), element: null };
      part.element = h("li", {}, h("span", { class: "faint" }, axis.title), part.shown, part.bar.element);
      return part;
    });
    this.element.replaceChildren(...this.#parts.map(({ element }) => element));
  }

  render() {
    for (const { axis, shown, bar, element } of this.#parts) {
      const steps = this.#device.state.positions[axis.motor - 1];
      setText(shown, steps === undefined ? "–" : axis.text(steps));
      bar.show(axis, this.#device.limitsOf(axis.motor), steps);
      element.classList.toggle("moves", this.#device.moves(axis.motor));
    }
  }
}
