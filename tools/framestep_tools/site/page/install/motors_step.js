// Step 4: switches, and one motor at a time, a little way and only while a button is held.

import { check, field, h, setText } from "framestep-console/dom.js";
import { M } from "framestep-console/protocol.js";

const SPEED = 1000; // of 10 000, the motor's own velocity
const REACH = 800; // steps that one hold may move
const LOOK_MS = 300;

export class MotorsStep {
  title = "4. Motors";
  element = h("section");
  #device;
  #holds;
  #swap;
  #motor = h("select", { onchange: () => this.#choose() });
  #sure = h("input", { onchange: () => this.#choose() });
  #buttons;
  #question = h("div", { class: "row", hidden: true });
  #where = h("output", { class: "position" });
  #switches = h("table", {});
  #seen = new Map(); // switch -> its states so far
  #timer = 0;

  /** swap: swaps a motor's direction in the rig file's form and shows it; next: shows the next step. */
  constructor(device, holds, swap, next) {
    this.#device = device;
    this.#holds = holds;
    this.#swap = swap;
    this.#buttons = [["−", "down", -1], ["+", "up", 1]].map(([sign, word, way]) => holds.button(
      h("button", { type: "button", class: "hold", "aria-label": `Jog ${word}`, disabled: true }, sign), `install ${word}`, ...this.#requests(way)));
    this.#question.append("Did it go up for + and down for −, as you want it? ",
      h("button", { type: "button", onclick: () => this.#next() }, "Yes, the next motor"),
      h("button", { type: "button", onclick: () => this.#swap(Number(this.#motor.value)) }, "No, swap its direction"));
    this.element.append(
      h("article", { class: "card", "aria-label": "Switches" }, h("h2", {}, "Switches"),
        h("p", {}, "Press the E-stop and each switch once, and let go: each must show both of its states."), h("div", { class: "wide" }, this.#switches)),
      h("article", { class: "card", "aria-label": "One motor at a time" }, h("h2", {}, "One motor at a time"),
        field("Motor", this.#motor),
        check("The load is off, and my hand is on the switch of the motors' supply", this.#sure),
        h("p", { class: "faint" }, `Hold a button: the motor goes slowly, ${REACH} steps at most, and stops when you let go.`),
        h("div", {}, this.#where, " ", h("span", { class: "unit" }, "steps")),
        h("div", { class: "row" }, ...this.#buttons), this.#question,
        h("div", { class: "row" }, h("button", { type: "button", onclick: next }, "Next: the first move"))));
  }

  connected() {
    this.#motor.replaceChildren(...Array.from({ length: this.#device.motors }, (_, i) => h("option", { value: i + 1 }, `Motor ${i + 1}`)));
    this.#sure.checked = false;
    this.#choose();
  }

  shown() {
    this.hidden();
    this.#look();
  }

  hidden() {
    clearTimeout(this.#timer);
    this.#timer = 0;
  }

  render() {
    setText(this.#where, String(this.#device.state.positions[Number(this.#motor.value) - 1] ?? "–"));
  }

  #choose() {
    this.#holds.releaseAll();
    this.#question.hidden = true;
    for (const button of this.#buttons) button.disabled = !this.#sure.checked;
    this.render();
  }

  #next() {
    this.#motor.selectedIndex = (this.#motor.selectedIndex + 1) % this.#motor.length;
    this.#choose();
  }

  /** Return a hold's repeated request and its stop. */
  #requests(way) {
    let target = null;
    const jog = async () => {
      const motor = Number(this.#motor.value);
      target ??= (this.#device.state.positions[motor - 1] ?? 0) + way * REACH;
      try {
        await this.#device.demand("MotorJog", { motor, speed: SPEED, destination: target });
      } catch (error) {
        this.#device.tell(error.message, true);
        throw error;
      }
    };
    const end = () => {
      target = null;
      this.#question.hidden = false;
      if (this.#device.client) this.#device.ask("MotorStop", { motor: Number(this.#motor.value) });
    };
    return [jog, end];
  }

  /** Ask for the switches while the view is shown. */
  async #look() {
    const found = this.#device.connected && !document.hidden ? await this.#device.settingsOf(1) : null;
    if (found) this.#showSwitches(found);
    if (!this.element.hidden) this.#timer = setTimeout(() => this.#look(), LOOK_MS);
  }

  #showSwitches({ upper_active: upper, lower_active: lower }) {
    const { conditions, info, inputs } = this.#device.state;
    if (!info) return;
    const rows = [["E-stop", conditions & M.CONDITION_ESTOP ? "held" : "released, or there is none"]];
    for (let i = 0; i < info.limit_sets && lower !== undefined; i += 1) {
      rows.push([`Limit set ${i + 1}, lower`, (lower >>> i) & 1 ? "active" : "clear"], [`Limit set ${i + 1}, upper`, (upper >>> i) & 1 ? "active" : "clear"]);
    }
    for (let i = 0; i < info.inputs; i += 1) rows.push([`Input ${i + 1}`, (inputs >>> i) & 1 ? "on" : "off"]);
    this.#switches.replaceChildren(h("tbody", {}, ...rows.map(([name, state]) => {
      if (!this.#seen.has(name)) this.#seen.set(name, new Set());
      const both = this.#seen.get(name).add(state).size > 1;
      return h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, state), h("td", { class: both ? "known" : "faint" }, both ? "✓ seen both ways" : "not switched yet"));
    })));
  }
}
