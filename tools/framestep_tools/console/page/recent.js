// What has been used lately, newest first, in the browser: moves, set-ups of virtual axes.

import { field, h } from "./dom.js";

const MOST = 8;
const LONGEST = 1_000_000; // characters of a list: a browser keeps some five million in all

/** A field to choose from, hidden while nothing is there. `use` is called with the content of what is chosen. */
export class Recent {
  element;
  #key;
  #choice = h("select");

  /** key: where the browser keeps it; title: of the field. */
  constructor(key, title, use) {
    this.#key = key;
    this.element = field(title, this.#choice);
    this.#choice.addEventListener("change", () => {
      const found = this.#list()[Number(this.#choice.value)];
      this.#choice.value = "";
      if (found) use(found.content, found.name);
    });
    this.#show();
  }

  /** The content of the newest one, or null. */
  get newest() {
    return this.#list()[0]?.content ?? null;
  }

  /** The newest one, {name, content}, or null. */
  get newestEntry() {
    return this.#list()[0] ?? null;
  }

  /** Put something first. One with the same name and content is there only once. content: of strings, numbers, lists. */
  add(name, content) {
    const text = JSON.stringify(content);
    const list = [{ name, content, at: Date.now() }, ...this.#list().filter((each) => each.name !== name || JSON.stringify(each.content) !== text)].slice(0, MOST);
    while (list.length && JSON.stringify(list).length > LONGEST) list.pop();
    try {
      localStorage.setItem(this.#key, JSON.stringify(list));
    } catch { /* the browser is full: it keeps the list that it has */ }
    this.#show();
  }

  #list() {
    try {
      const list = JSON.parse(localStorage.getItem(this.#key) ?? "[]");
      return Array.isArray(list) ? list : [];
    } catch {
      return []; // what an older page has left
    }
  }

  #show() {
    const list = this.#list();
    this.element.hidden = list.length === 0;
    this.#choice.replaceChildren(h("option", { value: "" }, "choose…"), ...list.map(({ name, at }, i) => h("option", { value: String(i) }, `${name}, ${new Date(at).toLocaleString()}`)));
  }
}
