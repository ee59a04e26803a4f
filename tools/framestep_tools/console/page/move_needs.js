// What a move needs of each motor, next to what is set: from the differences between its frames. The board has the last
// word; this shows beforehand which motor is too slow.

import { h } from "./dom.js";

/** Return the greatest velocity and acceleration of each motor between frames, [{velocity, acceleration}], in steps. */
export function needs(move, fps) {
  return move.positions.map((steps) => {
    let [velocity, acceleration, before] = [0, 0, 0];
    for (let at = 1; at < steps.length; at += 1) {
      const change = steps[at] - steps[at - 1];
      velocity = Math.max(velocity, Math.abs(change));
      if (at > 1) acceleration = Math.max(acceleration, Math.abs(change - before));
      before = change;
    }
    return { velocity: Math.ceil(velocity * fps), acceleration: Math.ceil(acceleration * fps * fps) };
  });
}

/** A table of these, and of the device's settings. */
export class MoveNeeds {
  element = h("div", { class: "wide" });
  #device;

  constructor(device) {
    this.#device = device;
  }

  /** Show what a move needs, and ask the device what is set. */
  async show(move, fps) {
    const rows = [];
    for (const [index, need] of needs(move, fps).entries()) {
      const motor = move.motors[index];
      const set = motor <= this.#device.motors ? await this.#device.settingsOf(motor) : null;
      rows.push({ motor, need, set });
    }
    const cell = (axis, need, set, per) => h("td", { class: set !== undefined && need > set ? "lost" : "" },
      axis.fullRate(need, per), set === undefined ? "" : `, set ${axis.fullRate(set, per)}${need > set ? ": too little" : ""}`);
    this.element.replaceChildren(rows.length ? h("table", {},
      h("caption", { class: "faint" }, `What the move needs at ${fps} frames/s`),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Motor"), h("th", { scope: "col" }, "Velocity"), h("th", { scope: "col" }, "Acceleration"))),
      h("tbody", {}, ...rows.map(({ motor, need, set }) => {
        const axis = this.#device.axes.of(motor);
        return h("tr", {}, h("th", { scope: "row" }, axis.title), cell(axis, need.velocity, set?.velocity, "s"), cell(axis, need.acceleration, set?.acceleration, "s²"));
      }))) : "");
  }
}
