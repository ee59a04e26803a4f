// Step 3: the rig file as a form; its differences are shown before the board gets it.

import { download, h, setText } from "framestep-console/dom.js";
import { RIG_TASKS } from "framestep-console/protocol.js";
import { differences, RigForm } from "framestep-console/rig_form.js";
import { mistake, warnings } from "framestep-console/rig_text.js";
import { RigWork } from "framestep-console/rig_work.js";

const NAME = "rig.json";

export class RigStep {
  title = "3. Rig file";
  worksAlone = true;
  element = h("section");
  #work;
  #board;
  #schema = null;
  #form = null;
  #before = {}; // the board's file
  #known = false; // it has been read
  #place = h("div");
  #said = h("p", { role: "status" });
  #changes = h("ul", { "aria-label": "Differences" });
  #shared = h("p");
  #put;
  #buttons = [];
  #busy = false;

  /** board: returns the chosen board's entry; next: shows the next step. */
  constructor(device, board, next) {
    this.#work = new RigWork(device, () => board().foreground);
    this.#board = board;
    const button = (text, work, main = false) => {
      const made = h("button", { type: "button", class: main ? "main" : "", onclick: () => this.#do(work) }, text);
      this.#buttons.push(made);
      return made;
    };
    this.#put = button("Put it onto the board", () => this.#write(), true);
    this.#put.hidden = true;
    this.element.append(
      h("article", { class: "card", "aria-label": "Rig file" }, h("h2", {}, "What your rig has"),
        h("p", { class: "faint" }, "Every setting has a default, so begin with few. An empty field leaves its setting out."),
        h("div", { class: "row" }, button("Read from the board", () => this.#read()),
          h("button", { type: "button", onclick: () => this.#do(() => this.#example()) }, "Take the board's example")),
        this.#place),
      h("article", { class: "card", "aria-label": "Onto the board" }, h("h2", {}, "Onto the board"),
        h("p", { class: "faint" }, "The board restarts with it, and the drivers go off: support what would fall."),
        this.#shared,
        h("div", { class: "row" }, button("Check, and show the differences", () => this.#look()), this.#put,
          h("button", { type: "button", onclick: () => this.#do(() => this.#save()) }, `Download ${NAME}`),
          h("button", { type: "button", onclick: next }, "Next: the motors")),
        this.#said, this.#changes));
  }

  async shown() {
    if (this.#form) return;
    await this.#do(async () => {
      const schema = await this.#load();
      if (!this.#form) this.#fill(schema, {}); // the board's file may have come meanwhile
    });
  }

  connected() {
    this.render();
  }

  render() {
    setText(this.#shared, this.#board().foreground ? `The ${this.#board().name} restarts also when its file is read: framestep ends when the REPL is used.` : "");
    for (const button of this.#buttons) button.disabled = this.#busy || !this.#work.possible;
  }

  /** Fill the form with the board's file. */
  async read() {
    await this.#do(() => this.#read());
  }

  async #read() {
    const { text, there } = await this.#work.read();
    this.#before = JSON.parse(text);
    this.#known = true;
    await this.#fillSound(this.#before, there ? "This is the board's rig file." : "The board has no rig file yet: every setting is at its default.");
  }

  /** Swap a motor's direction in the form. */
  async invert(motor) {
    await this.shown();
    const value = structuredClone(this.#form.read());
    value.motors = Array.from({ length: Math.max(motor, value.motors?.length ?? 0) }, (_, i) => value.motors?.[i] ?? {});
    const settings = value.motors[motor - 1];
    if (settings.invert) delete settings.invert;
    else settings.invert = true;
    this.#fill(this.#schema, value);
    setText(this.#said, `Motor ${motor}'s direction is swapped in the form: check it, and put it onto the board.`);
  }

  #example() {
    const { example } = this.#board();
    if (!example) throw new Error("There is an example for each board: choose yours in the first step.");
    return this.#fillSound(example, "This is the example of the board's page: change it to what your rig has.");
  }

  /** Fill the form; a file with a mistake cannot be shown. */
  async #fillSound(value, said) {
    const schema = await this.#load();
    const wrong = mistake(value, schema);
    this.#fill(schema, wrong ? {} : value);
    setText(this.#said, wrong ? `The board's ${NAME} has a mistake (${wrong}): the form begins empty.` : said);
  }

  async #load() {
    this.#schema ??= await (await fetch("rig.schema.json")).json();
    return this.#schema;
  }

  #fill(schema, value) {
    if (!this.#form) {
      this.#form = new RigForm(schema, RIG_TASKS, () => this.#forget());
      this.#place.append(this.#form.element);
    }
    this.#form.show(value, this.#board().motors);
    this.#forget();
  }

  /** The differences shown are no longer those of the form. */
  #forget() {
    this.#put.hidden = true;
    this.#changes.replaceChildren();
    setText(this.#said, "");
  }

  /** Return the file's text. Throws an error with its first mistake. */
  #text() {
    const value = this.#form.read();
    const wrong = mistake(value, this.#schema);
    if (wrong) throw new Error(`${NAME}: ${wrong}`);
    return `${JSON.stringify(value, null, 1)}\n`;
  }

  async #look() {
    this.#forget();
    const text = this.#text();
    const { foreground } = this.#board();
    if (!foreground || !this.#known) this.#before = JSON.parse((await this.#work.read()).text);
    this.#known = true;
    const found = differences(this.#before, JSON.parse(text));
    if (found.length === 0) {
      setText(this.#said, "The board has exactly these settings.");
      return;
    }
    // an ESP32 checks it as it gets it
    const verdict = foreground ? "What changes:" : `The board would accept it (${await this.#work.check(text)}). What changes:`;
    const cautions = warnings(JSON.parse(text)).map((line) => h("li", { class: "lost" }, `Warning: ${line}`));
    this.#changes.replaceChildren(...found.map((line) => h("li", {}, line)), ...cautions);
    setText(this.#said, verdict);
    this.#put.hidden = false;
  }

  async #write() {
    const text = this.#text();
    const said = await this.#work.write(text, (part) => setText(this.#said, part));
    this.#before = JSON.parse(text);
    this.#forget();
    setText(this.#said, said);
  }

  #save() {
    download(NAME, this.#text(), "application/json");
  }

  async #do(work) {
    this.#busy = true;
    this.render();
    this.#said.className = "";
    try {
      await work();
    } catch (error) {
      this.#said.className = "lost";
      setText(this.#said, error.message);
    } finally {
      this.#busy = false;
      this.render();
    }
  }
}
