// A form for a rig file, made of its schema. A field that is left empty leaves the setting out, so its default applies.

import { check, field, h, setText } from "./dom.js";
import { allowed, mistake } from "./rig_text.js";

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;
const GROWS_ALONE = "motors"; // its entries are the board's motors; others are added by hand
const A_MOTOR = /^motors\[\d+\]$/;

export class RigForm {
  element = h("div", { class: "rig-form" });
  #schema;
  #groups;
  #motors = 0;
  #root = null;

  /** schema: rig.schema.json; groups: {title: keys}; onchange: called when a field has changed. */
  constructor(schema, groups, onchange) {
    this.#schema = schema;
    this.#groups = groups;
    this.element.addEventListener("input", onchange);
    this.element.addEventListener("rig-change", onchange);
  }

  /** Fill the form with a rig file's content. motors: how many motors the board has. */
  show(value, motors = this.#motors) {
    this.#motors = motors;
    this.#root = new ObjectField(this.#schema, "", value, (key) => (key === GROWS_ALONE ? motors : 0));
    const { fields } = this.#root;
    this.element.replaceChildren(...Object.entries(this.#groups).map(([title, keys]) => {
      const mine = keys.filter((key) => fields.has(key));
      return h("details", { hidden: mine.length === 0, open: mine.some((key) => Object.hasOwn(value, key)) },
        h("summary", {}, title), h("div", { class: "settings" }, ...mine.map((key) => fields.get(key).element)));
    }));
  }

  /** Return the rig file's content. */
  read() {
    return this.#root.read() ?? {};
  }
}

/** Make what edits a value of a schema at a key such as "motors[2].driver". */
function fieldOf(schema, key, value, entries) {
  if (schema.type === "object") return new OptionalObject(schema, key, value);
  if (schema.type === "array") return new ListField(schema, key, value, entries);
  return new ScalarField(schema, key, value);
}

function lastOf(key) {
  return key.split(".").at(-1);
}

/** A number, a text, or a choice. */
class ScalarField {
  #schema;
  #key;
  #input;
  #said = h("span", { class: "lost", role: "status" });

  constructor(schema, key, value) {
    this.#schema = schema;
    this.#key = key;
    const unset = schema.default === undefined ? "" : JSON.stringify(schema.default);
    const choices = schema.type === "boolean" ? [true, false] : schema.enum;
    const given = value === undefined ? "" : typeof value === "string" && !choices ? value : JSON.stringify(value);
    this.#input = choices
      ? h("select", {}, h("option", { value: "" }, `default${unset && `, ${unset}`}`), ...choices.map((choice) => h("option", { value: JSON.stringify(choice) }, JSON.stringify(choice))))
      : h("input", { type: "text", placeholder: schema.type === "string" ? schema.default ?? "" : unset, spellcheck: false, autocomplete: "off" });
    this.#input.value = given;
    this.#input.setAttribute("aria-label", key);
    this.#input.addEventListener("input", () => this.#judge());
    const made = field(lastOf(key), this.#input, `${schema.description ?? ""}${choices ? "" : `; allowed: ${allowed(schema)}`}${unset || choices ? "" : "; required"}`);
    this.element = h("div", { class: "setting" }, made, this.#said);
    this.#judge();
  }

  read() {
    const text = this.#input.value;
    if (text === "") return undefined;
    if (this.#input.tagName === "SELECT") return JSON.parse(text);
    if (this.#schema.type === "string") return text;
    return NUMBER.test(text.trim()) ? Number(text) : text;
  }

  #judge() {
    const value = this.read();
    const wrong = value === undefined ? null : mistake(value, this.#schema, this.#key);
    this.#input.setAttribute("aria-invalid", String(wrong !== null));
    setText(this.#said, wrong ?? "");
  }
}

/** An object: `fields` by key. Keys that the schema does not know stay, for its check to name them. */
class ObjectField {
  fields = new Map();
  #before;

  constructor(schema, key, value, entries = () => 0) {
    this.#before = value;
    for (const [name, each] of Object.entries(schema.properties)) {
      this.fields.set(name, fieldOf(each, key ? `${key}.${name}` : name, value[name], entries(name)));
    }
  }

  get elements() {
    return [...this.fields.values()].map(({ element }) => element);
  }

  /** Return the object, its keys in the order of before. */
  read() {
    const found = {};
    for (const name of new Set([...Object.keys(this.#before), ...this.fields.keys()])) {
      const value = this.fields.has(name) ? this.fields.get(name).read() : this.#before[name];
      if (value !== undefined) found[name] = value;
    }
    return found;
  }
}

/** An object that may be left out as a whole. */
class OptionalObject {
  #on;
  #fields;

  constructor(schema, key, value) {
    this.#fields = new ObjectField(schema, key, value ?? {});
    const inner = h("div", { class: "settings", hidden: value === undefined }, ...this.#fields.elements);
    this.#on = h("input", { checked: value !== undefined, onchange: () => {
      inner.hidden = !this.#on.checked;
    } });
    const title = check(`Set ${lastOf(key)}`, this.#on);
    this.element = h("fieldset", {}, h("legend", {}, key), title, h("small", {}, schema.description ?? ""), inner);
  }

  read() {
    return this.#on.checked ? this.#fields.read() : undefined;
  }
}

/** A list of objects. entries: how many there always are; 0: the user adds and removes them. */
class ListField {
  #schema;
  #key;
  #items = [];
  #list = h("div", { class: "entries" });
  #least;
  #given;

  constructor(schema, key, value, entries) {
    this.#schema = schema;
    this.#key = key;
    this.#least = entries;
    this.#given = value !== undefined;
    this.element = h("div", { class: "list" }, h("p", {}, h("strong", {}, key), h("small", {}, ` ${schema.description ?? ""}`)), this.#list,
      entries ? null : h("button", { type: "button", onclick: () => this.#add() }, `Add to ${key}`));
    this.#show(Array.from({ length: Math.max(entries, value?.length ?? 0) }, (_, i) => value?.[i] ?? {}));
  }

  /** Return the list; entries without settings at its end are left out, if there is one for each motor. */
  read() {
    const found = this.#items.map((item) => item.read());
    if (this.#least) while (found.length && Object.keys(found.at(-1)).length === 0) found.pop();
    return found.length || (this.#given && !this.#least) ? found : undefined;
  }

  #show(values) {
    this.#items = values.map((value, i) => new ObjectField(this.#schema.items, `${this.#key}[${i + 1}]`, value));
    this.#list.replaceChildren(...this.#items.map((item, i) => this.#entry(item, i, values[i])));
  }

  #entry(item, i, value) {
    const name = `${this.#key}[${i + 1}]`;
    const inner = h("div", { class: "settings" }, ...item.elements);
    if (this.#least) return h("details", { open: Object.keys(value).length > 0 }, h("summary", {}, name), inner);
    return h("fieldset", {}, h("legend", {}, name), inner, h("button", { type: "button", onclick: () => this.#remove(i) }, `Remove ${name}`));
  }

  #add() {
    this.#change((values) => values.push({}));
  }

  #remove(i) {
    this.#change((values) => values.splice(i, 1));
  }

  #change(how) {
    const values = this.#items.map((item) => item.read());
    how(values);
    this.#show(values);
    this.element.dispatchEvent(new CustomEvent("rig-change", { bubbles: true }));
  }
}

/** Return a line for each setting that differs: "motors[2].invert: not set → true". */
export function differences(before, after) {
  const [old, now] = [leaves(before), leaves(after)];
  return [...new Set([...old.keys(), ...now.keys()])].filter((key) => old.get(key) !== now.get(key))
    .map((key) => `${key}: ${old.get(key) ?? "not set"} → ${now.get(key) ?? "not set"}`);
}

/** Return {key: value as JSON} of all settings that are no list or object, and of empty ones. A motor without settings is
 * none. */
function leaves(value, key = "", found = new Map()) {
  const inner = Array.isArray(value) ? value.map((each, i) => [`${key}[${i + 1}]`, each])
    : value !== null && typeof value === "object" ? Object.entries(value).map(([name, each]) => [key ? `${key}.${name}` : name, each]) : null;
  if (!inner || (inner.length === 0 && key && !A_MOTOR.test(key))) found.set(key, JSON.stringify(value));
  else for (const [name, each] of inner) leaves(each, name, found);
  return found;
}
