// The rig file and the board's load: both by the board's other port, through framestep console.

import { h, setText } from "../dom.js";

export class RigView {
  title = "Rig file, load";
  element = h("section");
  #device;
  #text = h("textarea", { rows: 18, spellcheck: false, "aria-label": "Rig file" });
  #said = h("pre", { role: "status" });
  #load = h("pre", { role: "status" });
  #buttons = [];
  #help = h("div", { class: "wide" });
  #without = h("p", { class: "faint" });

  constructor(device) {
    this.#device = device;
    const button = (text, work, main = false) => {
      const made = h("button", { type: "button", class: main ? "main" : "", onclick: () => this.#busy(work) }, text);
      this.#buttons.push(made);
      return made;
    };
    this.element.append(
      this.#without,
      h("article", { class: "card", "aria-label": "Rig file of the board" },
        h("h2", {}, "Rig file"),
        h("p", { class: "faint" }, "Putting it onto the board restarts the board: the drivers go off, so support what would fall. // comments are left out."),
        h("div", { class: "row" },
          button("Read from the board", () => this.#read()),
          button("Check", () => this.#check()),
          button("Put onto the board", () => this.#write(), true)),
        this.#text, this.#said,
        h("details", { ontoggle: () => this.#showHelp() }, h("summary", {}, "All settings"), this.#help)),
      h("article", { class: "card", "aria-label": "Load of the board" },
        h("h2", {}, "The board's load"),
        h("div", { class: "row" }, button("Measure", () => this.#measure())),
        this.#load),
    );
  }

  connected() {
    const { repl } = this.#device.hello;
    for (const button of this.#buttons) button.disabled = !repl;
    setText(this.#without, repl ? "" : "The rig file and the load are asked on the board's REPL, and this device shows no port for it: start framestep console with --repl, or use framestep rig edit.");
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
    for (const button of this.#buttons) button.disabled = !this.#device.hello?.repl;
  }

  async #read() {
    const found = await this.#ask("read_rig");
    this.#text.value = found.text;
    setText(this.#said, found.there ? "As it is on the board." : "The board has none: all settings are at their defaults.");
  }

  async #check() {
    setText(this.#said, (await this.#ask("check_rig", { text: this.#text.value })).text);
  }

  async #write() {
    setText(this.#said, "The board takes it and restarts …");
    const found = await this.#ask("write_rig", { text: this.#text.value });
    setText(this.#said, found.text);
    await this.#device.greet();
  }

  async #measure() {
    setText(this.#load, (await this.#ask("load")).lines.join("\n"));
  }

  #ask(task, values) {
    if (!this.#device.client) return Promise.reject(new Error("no device is connected"));
    return this.#device.client.ask(task, values);
  }

  async #showHelp() {
    if (this.#help.hasChildNodes()) return;
    const schema = await (await fetch("rig.schema.json")).json();
    this.#help.append(h("table", {},
      h("thead", {}, h("tr", {}, ...["Setting", "Meaning", "Allowed", "Default"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, ...rows(schema, ""))));
  }
}

/** A row for each setting of a schema, those of lists and objects behind theirs. */
function rows(schema, before) {
  return Object.entries(schema.properties ?? {}).flatMap(([name, each]) => {
    const inner = each.items?.properties ? [each.items, `${before}${name}[].`] : [each, `${before}${name}.`];
    const row = h("tr", {}, h("td", {}, h("code", {}, before + name)), h("td", {}, each.description ?? ""), h("td", {}, allowed(each)), h("td", {}, each.default === undefined ? "–" : JSON.stringify(each.default)));
    return [row, ...rows(...inner)];
  });
}

function allowed({ type, enum: choices, minimum, maximum, minLength, maxLength, maxItems }) {
  if (choices) return choices.map((choice) => JSON.stringify(choice)).join(", ");
  if (minimum !== undefined) return `${minimum} to ${maximum}`;
  if (maxLength !== undefined) return `${minLength} to ${maxLength} bytes of text`;
  if (maxItems !== undefined) return `a list of at most ${maxItems}`;
  return { boolean: "true, false", array: "a list", object: "an object" }[type] ?? type;
}
