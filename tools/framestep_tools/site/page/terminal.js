// A terminal on the board's REPL.

import { FitAddon } from "@xterm/addon-fit";
import { Terminal } from "@xterm/xterm";
import { h } from "framestep-console/dom.js";

const ROWS = 12;
const ENTER = "\r";

export class ReplTerminal {
  element;
  #terminal = new Terminal({ rows: ROWS, fontSize: 13, screenReaderMode: true });
  /** Number of entered lines. */
  lines = 0;
  #port;

  /** port: the REPL's BoardPort; controls: elements next to the title. */
  constructor(port, ...controls) {
    this.#port = port;
    const place = h("div", { class: "terminal-place" });
    this.element = h("article", { class: "card", "aria-label": "REPL" },
      h("div", { class: "row spread" }, h("h3", {}, "REPL"), ...controls), place);
    const fit = new FitAddon();
    this.#terminal.loadAddon(fit);
    this.#terminal.open(place);
    new ResizeObserver(() => {
      const columns = fit.proposeDimensions()?.cols;
      if (columns) this.#terminal.resize(columns, ROWS);
    }).observe(place);
    this.#terminal.onData((text) => this.type(text));
    port.listen((bytes) => this.#terminal.write(bytes));
  }

  /** Send the user's typing. It is lost while the page itself uses the REPL, for the rig file or the load. */
  type(text) {
    if (this.#port.taken) return;
    this.#port.write(new TextEncoder().encode(text));
    this.lines += text.split(ENTER).length - 1;
  }

  /** Type a line for the user. */
  enter(line) {
    this.element.scrollIntoView({ block: "nearest" });
    this.type(line + ENTER);
    this.#terminal.focus();
  }

  /** Let the board show its prompt. */
  greet() {
    this.#port.write(new TextEncoder().encode(ENTER));
  }
}
