// Axes: the names and units of the motors, read from axes.toml and written to it.

import { axesText, cameraText, checkAxes, parseAxes } from "./axes.js";
import { check, download, field, h, number, read, setText } from "./dom.js";
import { UNITS } from "./protocol.js";

const SAVED = "axes.toml"; // in the browser, without a server
const FEWEST_ROWS = 4;
const GREATEST = 1e15;

export class AxesView {
  title = "Names and units";
  element = h("div", { class: "parts" });
  #device;
  #rows = [];
  #camera = ""; // the text of [camera], which stays as it is
  #list = h("div", { class: "cards" });
  #which = h("select", { onchange: () => this.#choose(Number(this.#which.value)) });
  #whose = field("Motor", this.#which);
  #about = h("p", { class: "faint" });
  #file = h("input", { type: "file", accept: ".toml", onchange: () => this.#open() });

  constructor(device) {
    this.#device = device;
    device.axes.addEventListener("change", () => this.#fill());
    this.element.append(
      h("article", { class: "card", "aria-label": "Names and units" },
        
        this.#about,
        h("p", { class: "faint" }, "Every command of framestep uses the same file, axes.toml. Limits are for positions typed here in units; soft limits on the board are in each motor's settings."),
        h("div", { class: "row" }, field("Take another axes.toml", this.#file),
          h("button", { type: "button", class: "main", onclick: () => this.#save() }, "Save"),
          h("button", { type: "button", onclick: () => this.#download() }, "Download"))),
      this.#whose, this.#list);
    this.#whose.classList.add("one-motor");
    this.#take(localStorage.getItem(SAVED));
    this.#fill();
  }

  connected() {
    const { axes } = this.#device.hello;
    if (axes?.error) this.#device.tell(`${axes.error}; the page shows steps.`, true);
    else if (axes) this.#take(axes.text);
    setText(this.#about, axes ? `They are in ${axes.path}. Saving rewrites that file, without its comments.` : "They are kept in this browser. Download them for the commands of framestep.");
    this.#fill();
  }

  render() {}

  /** Use the text of an axes.toml; null or an empty one: no names. A mistake is shown. */
  #take(text) {
    try {
      this.#device.axes.set(text ? parseAxes(text) : []);
      this.#camera = cameraText(text ?? "");
      return true;
    } catch (error) {
      this.#device.tell(`axes.toml: ${error.message}`, true);
      return false;
    }
  }

  async #open() {
    const [file] = this.#file.files;
    if (file && this.#take(await file.text())) this.#device.tell(`${file.name}: names and units are in use. Save keeps them.`);
  }

  #fill() {
    const { list } = this.#device.axes;
    const count = Math.max(this.#device.motors || FEWEST_ROWS, ...list.map(({ motor }) => motor));
    this.#rows = Array.from({ length: count }, (_, i) => new Row(i + 1, list.find(({ motor }) => motor === i + 1)));
    this.#which.replaceChildren(...this.#rows.map((row, i) => h("option", { value: String(i) }, row.title)));
    this.#list.replaceChildren(...this.#rows.map((row) => row.element));
    this.#choose(0);
  }

  /** Show a motor's fields; only a phone hides the others. */
  #choose(index) {
    this.#which.value = String(index);
    for (const [i, row] of this.#rows.entries()) row.element.classList.toggle("not-chosen", i !== index);
  }

  /** Return the axes in the fields; null for a mistake, which is shown. */
  #read() {
    const list = [];
    for (const [i, row] of this.#rows.entries()) {
      if (row.wrong) this.#choose(i); // the browser points at its field
      const axis = row.read();
      if (axis === null) return null;
      if (axis) list.push(axis);
    }
    try {
      return checkAxes(list);
    } catch (error) {
      this.#device.tell(error.message, true);
      return null;
    }
  }

  async #save() {
    const list = this.#read();
    if (!list) return;
    if (!list.length) {
      this.#device.tell("No motor has a name, so there is nothing to save.", true);
      return;
    }
    const text = axesText(list, this.#camera);
    const { axes } = this.#device.hello ?? {};
    try {
      if (axes) await this.#device.client.ask("write_axes", { text });
      else localStorage.setItem(SAVED, text);
    } catch (error) {
      this.#device.tell(`Nothing is saved: ${error.message}`, true);
      return;
    }
    this.#device.axes.set(list);
    this.#device.tell(`Names and units are saved ${axes ? `in ${axes.path}` : "in this browser"}.`);
  }

  #download() {
    const list = this.#read();
    if (list) download("axes.toml", axesText(list, this.#camera), "application/toml");
  }
}

/** One motor's fields. */
class Row {
  #motor;
  #before;
  #name;
  #unit;
  #perUnit;
  #zero;
  #limited;
  #low;
  #high;
  #invert;

  /** before: the settings in axes.toml, or undefined. */
  constructor(motor, before = {}) {
    this.#motor = motor;
    this.#before = before;
    const real = (value, props) => number(value, -GREATEST, GREATEST, { step: "any", inputMode: "decimal", ...props });
    this.#name = h("input", { type: "text", value: before.name ?? "", spellcheck: false });
    this.#unit = h("select", {}, ...UNITS.map((unit) => h("option", { value: unit }, unit)));
    this.#unit.value = before.unit ?? (before.name ? "units" : "deg");
    this.#perUnit = real(before.steps_per_unit ?? 1, { min: "0.000001", max: "1000000000" });
    this.#zero = real(before.zero ?? 0);
    this.#limited = h("input", { checked: before.limits !== undefined });
    [this.#low, this.#high] = [before.limits?.[0] ?? 0, before.limits?.[1] ?? 0].map((end) => real(end));
    this.#invert = h("input", { checked: before.invert ?? false });
    this.element = h("fieldset", { class: "card" }, h("legend", {}, `Motor ${motor}`),
      field("Name", this.#name, "empty: the motor has only its number"),
      h("div", { class: "row" }, field("Unit", this.#unit), field("Steps per unit", this.#perUnit)),
      field("Position at step 0", this.#zero),
      check("Steps count down while the position rises", this.#invert),
      check("Limits", this.#limited),
      h("div", { class: "row" }, field("Lowest", this.#low), field("Highest", this.#high)));
  }

  get title() {
    return this.#before.name ? `${this.#motor} ${this.#before.name}` : `Motor ${this.#motor}`;
  }

  /** Whether a field is wrong. */
  get wrong() {
    return this.#name.value.trim() !== "" && [this.#perUnit, this.#zero, this.#low, this.#high].some((input) => !input.checkValidity());
  }

  /** Return the axis, undefined for a motor without a name, null for a wrong field. */
  read() {
    const name = this.#name.value.trim();
    if (name === "") return undefined;
    const [perUnit, zero, low, high] = [this.#perUnit, this.#zero, this.#low, this.#high].map(read);
    if ([perUnit, zero, low, high].includes(null)) return null;
    return {
      ...this.#before, // keys that only files of other programs use
      name,
      motor: this.#motor,
      steps_per_unit: perUnit,
      unit: this.#unit.value,
      zero: zero || undefined,
      limits: this.#limited.checked ? [low, high] : undefined,
      invert: this.#invert.checked || undefined,
    };
  }
}
