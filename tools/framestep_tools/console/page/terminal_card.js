// A terminal on the board's REPL. xterm.js is loaded when it is opened.

import { h, setText } from "./dom.js";

const XTERM = "./xterm/xterm.mjs"; // not bundled into other pages
const FIT = "./xterm/addon-fit.mjs";
const STYLE = "xterm/xterm.css";
const ROWS = 20;
const INTERRUPT = "\x03";
const PASTE = "\x05"; // MicroPython's paste mode: no indents of its own
const PASTED = "\x04";

export class TerminalCard {
  #device;
  #client = null; // while it is open
  /** Number of entered lines. */
  lines = 0;
  #terminal = null;
  #fit;
  #place = h("div", { class: "terminal-place" });
  #said = h("p", { role: "status" });
  #open = h("button", { type: "button", onclick: () => this.#begin() }, "Open a terminal");
  #interrupt = h("button", { type: "button", hidden: true, onclick: () => this.#type(INTERRUPT) }, "Ctrl-C");
  #close = h("button", { type: "button", hidden: true, onclick: () => this.#end() }, "Close it");

  constructor(device) {
    this.#device = device;
    this.element = h("article", { class: "card", "aria-label": "REPL" }, h("h3", {}, "The REPL"),
      h("p", { class: "faint" }, "MicroPython's prompt; framestep goes on meanwhile. Ctrl-C ends what you run there. Escape is STOP also here."),
      h("div", { class: "row" }, this.#open, this.#interrupt, this.#close), this.#said, this.#place);
    new ResizeObserver(() => this.#resize()).observe(this.#place);
  }

  /** Type a line for the user. */
  async enter(line) {
    if (!this.#client) await this.#begin();
    this.#type(`${line}\r`);
    this.#terminal?.focus();
  }

  /** Show whether there is a port for it. */
  allow() {
    this.element.hidden = this.#device.connected && !this.#device.hello?.terminal;
    this.#open.disabled = !this.#device.hello?.terminal;
  }

  async #begin() {
    this.#open.disabled = true;
    setText(this.#said, "");
    try {
      await this.#load();
      const { client } = this.#device;
      await client.openTerminal({ text: (text) => this.#terminal.write(text), end: (why) => this.#ended(why) });
      this.#client = client;
      this.#show(true);
      this.#terminal.focus();
      this.#type("\r"); // lets the board show its prompt
    } catch (error) {
      setText(this.#said, error.message);
    }
    this.allow();
  }

  async #load() {
    if (this.#terminal) return;
    let parts;
    try {
      parts = await Promise.all([import(XTERM), import(FIT)]);
    } catch {
      throw new Error("this installation has no terminal, as it was built without xterm.js: take a release's package, or run make node in a clone");
    }
    if (this.#terminal) return; // asked for twice
    document.head.append(h("link", { rel: "stylesheet", href: STYLE }));
    const [{ Terminal }, { FitAddon }] = parts;
    this.#terminal = new Terminal({ rows: ROWS, fontSize: 13, screenReaderMode: true });
    this.#fit = new FitAddon();
    this.#terminal.loadAddon(this.#fit);
    this.#terminal.open(this.#place);
    this.#terminal.onData((text) => this.#type(text.length > 1 && text.includes("\r") ? PASTE + text + PASTED : text));
    this.#resize();
  }

  #resize() {
    const columns = this.#fit?.proposeDimensions()?.cols;
    if (columns) this.#terminal.resize(columns, ROWS);
  }

  #type(text) {
    if (!this.#client) return;
    this.#client.type(text);
    this.lines += text.split("\r").length - 1;
  }

  async #end() {
    const client = this.#client;
    this.#ended("");
    await client?.closeTerminal().catch(() => {});
  }

  #ended(why) {
    this.#client = null;
    this.#show(false);
    setText(this.#said, why && `The terminal has ended: ${why}.`);
    if (why) this.#terminal.write(`\r\n[${why}]\r\n`);
  }

  #show(open) {
    this.#open.hidden = open;
    this.#interrupt.hidden = this.#close.hidden = !open;
  }
}
