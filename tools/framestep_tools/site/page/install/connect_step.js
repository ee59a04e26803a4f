// Step 2: the board's two ports, and what the board says of itself.

import { h } from "framestep-console/dom.js";
import { VERSION } from "framestep-console/protocol.js";
import { serialIsThere } from "framestep-console/serial_link.js";

export class ConnectStep {
  title = "2. Connect";
  worksAlone = true;
  element = h("section");
  #device;
  #board;
  #onrepl;
  #ofRepl = h("li", {}, "Then the other one, for MicroPython's REPL. The rig file goes through it: ");
  #said = h("div", { role: "status" });
  #repl;
  #next;

  /** board: returns the chosen board's entry; connect: lets the user choose the protocol's port; onrepl: called once the REPL's
   * port is chosen; next: shows the next step. */
  constructor(device, board, connect, onrepl, next) {
    this.#device = device;
    this.#board = board;
    this.#onrepl = onrepl;
    this.#repl = h("button", { type: "button", onclick: () => this.#chooseRepl() }, "Choose the REPL's port…");
    this.#next = h("button", { type: "button", onclick: next }, "Next: the rig file");
    const steps = h("ol", { class: "what" },
      h("li", {}, "Choose the board's port for Dragonframe. If the board shows two, it is the one named “framestep DMC” where the system shows names: ",
        h("div", { class: "row" }, h("button", { type: "button", class: "main", onclick: connect }, "Choose Dragonframe's port…"))),
      this.#ofRepl);
    this.#ofRepl.append(h("div", { class: "row" }, this.#repl));
    this.element.append(h("article", { class: "card", "aria-label": "Connect" }, h("h2", {}, "Connect the board"),
      ...(serialIsThere() ? [steps, this.#said, h("div", { class: "row" }, this.#next)]
        : [h("p", {}, "This browser has no Web Serial: take Chrome or Edge on a computer, or framestep console from the package.")])));
  }

  render() {
    const { connected, hello, state } = this.#device;
    this.#repl.disabled = !connected || Boolean(hello?.repl);
    this.#ofRepl.hidden = this.#shares();
    if (connected && this.#shares() && !hello.repl) this.#share();
    this.#next.disabled = !connected || !hello?.repl;
    const lines = connected ? this.#lines(state.info) : ["Nothing is connected. If a chosen port does not answer, it may be the other one."];
    if ([...this.#said.children].map((line) => line.textContent).join("\n") !== lines.join("\n")) {
      this.#said.replaceChildren(...lines.map((line) => h("p", {}, line)));
    }
  }

  #lines({ name, major, minor, revision, motors }) {
    const version = `${major}.${minor}.${revision}`;
    const conditions = this.#device.conditionTexts();
    return [
      `${name} answers: firmware ${version}${version === VERSION ? ", as on this page" : `; this page is for ${VERSION}`}, ${motors} motor${motors === 1 ? "" : "s"}.`,
      conditions.length ? `Its condition: ${conditions.join("; ")}.` : "Its condition: all is well.",
      this.#ofRepl.hidden ? "" : this.#device.hello.repl ? "The REPL's port is chosen." : "The REPL's port is still to be chosen.",
    ];
  }

  /** Whether Dragonframe and the REPL have the same port. */
  #shares() {
    const { foreground, ports } = this.#board();
    return foreground && ports === 1;
  }

  #share() {
    this.#device.hello.repl = true;
    this.#device.client.useEndingRepl(true);
  }

  async #chooseRepl() {
    try {
      if (this.#board().foreground) await this.#device.client.useEndingRepl(false);
      else await this.#device.client.chooseRepl();
      this.#device.hello.repl = true;
      this.#onrepl();
    } catch (error) {
      this.#device.tell(error.message, true);
    }
    this.render();
  }
}
