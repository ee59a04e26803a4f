// The rig file and the board's load, through the board's other port: by framestep console or a second port of Web
// Serial.

import { h, setText, wide } from "./dom.js";
import { LoadCard } from "./load_card.js";
import { allowed, bareRig, warnings } from "./rig_text.js";
import { RigWork } from "./rig_work.js";
import { TerminalCard } from "./terminal_card.js";

export class RigFileView {
  title = "Rig file, load, terminal";
  element = h("div", { class: "parts" });
  #device;
  #work;
  #text = h("textarea", { rows: 18, spellcheck: false, "aria-label": "Rig file" });
  #said = h("pre", { role: "status" });
  #load;
  terminal;
  #buttons = [];
  #help = wide("Settings");
  #without = h("p", { class: "faint" });
  #choose = h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#chooseRepl() }, "Connect the REPL's port…"));

  constructor(device) {
    this.#device = device;
    this.#work = new RigWork(device);
    const button = (text, work, main = false) => {
      const made = h("button", { type: "button", class: main ? "main" : "", onclick: () => this.#busy(work) }, text);
      this.#buttons.push(made);
      return made;
    };
    this.#load = new LoadCard((task) => this.#work.ask(task), (text) => device.tell(text, true), button);
    this.terminal = new TerminalCard(device);
    device.addEventListener("gone", () => {
      this.#load.stop();
      this.terminal.allow();
    });
    this.element.append(
      this.#without,
      this.#choose,
      h("article", { class: "card", "aria-label": "Rig file of the board" },
        h("h3", {}, "Rig file"),
        h("p", { class: "faint" }, "Putting it onto the board restarts the board: the drivers go off, so support what would fall. // comments are left out."),
        h("div", { class: "row" },
          button("Read from the board", () => this.#read()),
          button("Check", () => this.#check()),
          button("Put onto the board", () => this.#write(), true)),
        this.#text, this.#said,
        h("details", { ontoggle: () => this.#showHelp() }, h("summary", {}, "All settings"), this.#help)),
      this.#load.element,
      this.terminal.element,
    );
  }

  connected() {
    this.#allow();
  }

  hidden() {
    this.#load.stop();
  }

  /** Show which tasks are possible, and which port has to be chosen first. */
  #allow() {
    const { client } = this.#device;
    const repl = this.#work.possible;
    for (const button of this.#buttons) button.disabled = !repl;
    this.#load.disabled = !repl;
    this.terminal.allow();
    this.#choose.hidden = repl || !client?.choosesRepl;
    const how = client?.choosesRepl ? "choose it, the first of the board's two, to have them." : "and this device shows no port for it: start framestep console with --repl, or use framestep rig edit.";
    setText(this.#without, repl ? "" : `The rig file and the load are asked on the board's REPL${client?.choosesRepl ? ": " : ", "}${how}`);
  }

  async #chooseRepl() {
    try {
      await this.#device.client.chooseRepl();
      this.#device.hello.repl = this.#device.hello.terminal = true;
    } catch (error) {
      this.#device.tell(error.message, true);
    }
    this.#allow();
  }

  render() {}

  async #busy(work) {
    for (const button of this.#buttons) button.disabled = true;
    try {
      await work();
    } catch (error) {
      setText(this.#said, error.message);
      this.#device.tell(error.message, true);
    }
    this.#allow();
  }

  async #read() {
    const found = await this.#work.read();
    this.#text.value = found.text;
    setText(this.#said, found.there ? "As it is on the board." : "The board has none: all settings are at their defaults.");
  }

  async #check() {
    const said = await this.#work.check(this.#text.value);
    setText(this.#said, [said, ...warnings(JSON.parse(bareRig(this.#text.value))).map((line) => `Warning: ${line}`)].join("\n"));
  }

  async #write() {
    const say = (text) => setText(this.#said, text);
    say("The board accepts it and restarts …");
    say(await this.#work.write(this.#text.value, say));
  }

  async #showHelp() {
    if (this.#help.hasChildNodes()) return;
    const schema = await (await fetch("rig.schema.json")).json();
    this.#help.replaceChildren(h("table", {},
      h("thead", {}, h("tr", {}, ...["Setting", "Meaning", "Allowed", "Default"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, ...rows(schema, ""))));
  }
}

/** Return a row for each setting of a schema; settings of lists and objects follow them. */
function rows(schema, before) {
  return Object.entries(schema.properties ?? {}).flatMap(([name, each]) => {
    const inner = each.items?.properties ? [each.items, `${before}${name}[].`] : [each, `${before}${name}.`];
    const row = h("tr", {}, h("td", {}, h("code", {}, before + name)), h("td", {}, each.description ?? ""), h("td", {}, allowed(each)), h("td", {}, each.default === undefined ? "–" : JSON.stringify(each.default)));
    return [row, ...rows(...inner)];
  });
}
