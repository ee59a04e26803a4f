// Making elements.

let nextId = 1;

/** Make an element: h("button", {class: "x", onclick: f, "aria-label": "…"}, "text", child). False and null children are left out. */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) set(element, name, value);
  element.append(...children.flat().filter((child) => child !== null && child !== false && child !== undefined));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** Make an element of a drawing. */
export function s(tag, props = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(props)) element.setAttribute(name, value);
  element.append(...children.flat().filter((child) => child !== null && child !== false));
  return element;
}

function set(element, name, value) {
  if (value === undefined || value === null) return;
  if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
  else if (name in element && name !== "list" && name !== "form") element[name] = value;
  else element.setAttribute(name, value);
}

/** Make a place for a table that may be wider than the page: keys can scroll it, too. */
export const wide = (label, ...children) => h("div", { class: "wide", role: "region", "aria-label": label, tabIndex: 0 }, ...children);

/** Make a label, with a hint, and its field below. */
export function field(label, input, hint) {
  input.id ||= `field-${nextId++}`;
  return h("div", { class: "field" }, h("label", { htmlFor: input.id }, label), hint ? h("small", {}, hint) : null, input);
}

/** Make a check box with its label after it. */
export function check(label, input) {
  input.type = "checkbox";
  input.id ||= `field-${nextId++}`;
  return h("div", { class: "check" }, input, h("label", { htmlFor: input.id }, label));
}

/** Make a field for a number, by default a whole one. */
export function number(value, least, most, props = {}) {
  return h("input", { type: "number", inputMode: "numeric", required: true, value: String(value), min: String(least), max: String(most), step: "1", ...props });
}

const LOWEST = -2147483648; // steps
const HIGHEST = 2147483647;

/** Make a field for a position of an axis, in its unit; `readSteps` returns its steps. */
export function positionField(axis, steps, props = {}) {
  if (!axis.scaled) return number(steps, LOWEST, HIGHEST, props);
  const [least, most] = [LOWEST, HIGHEST].map((end) => axis.position(end)).sort((a, b) => a - b);
  return number(axis.short(axis.position(steps)), least, most, { step: "any", inputMode: "decimal", ...props });
}

/** Show a position in such a field. */
export function showSteps(axis, input, steps) {
  input.value = axis.scaled ? axis.short(axis.position(steps)) : String(steps);
}

/** Return the steps in a field for a position, or null as `read` does. */
export function readSteps(axis, input) {
  const value = read(input);
  return value === null ? null : axis.steps(value);
}

/** Return the number in a field. Null if it is not allowed; the browser then says what is wrong. */
export function read(input) {
  return input.reportValidity() && input.value !== "" ? Number(input.value) : null;
}

/** Set an element's text if it differs, so as not to disturb screen readers and layout. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Return whether the user types in this element, so keys belong to it. */
export function takesText(element) {
  return element instanceof HTMLElement && (element.isContentEditable || /^(TEXTAREA|SELECT)$/.test(element.tagName)
    || (element.tagName === "INPUT" && !/^(button|checkbox|radio|submit)$/.test(element.type)));
}

const SURE_MS = 4000; // for which the first press counts

/** Two presses, where one would do too much. */
export class Twice {
  #act;
  #changed;
  #needed;
  #timer = 0;

  /** act: called at the second press; changed: called when `armed` has changed; needed: whether it takes two presses now. */
  constructor(act, changed, needed = () => true) {
    [this.#act, this.#changed, this.#needed] = [act, changed, needed];
  }

  /** Whether the next press acts. */
  get armed() {
    return this.#timer !== 0;
  }

  press() {
    const acts = this.armed || !this.#needed();
    this.#set(!acts);
    if (acts) this.#act();
  }

  /** Forget the first press. */
  rest() {
    this.#set(false);
  }

  #set(armed) {
    clearTimeout(this.#timer);
    this.#timer = armed ? setTimeout(() => this.#set(false), SURE_MS) : 0;
    this.#changed();
  }
}

/** Make a button that acts at its second press; `ask` is its text meanwhile. */
export function twice(text, ask, act, needed) {
  const button = h("button", { type: "button", onclick: () => presses.press(), onblur: () => presses.rest() }, text);
  const presses = new Twice(act, () => setText(button, presses.armed ? ask : text), needed);
  return button;
}

/** Return a function that lets `draw` be called with the next picture, once, however often it is called before. */
export function withPicture(draw) {
  let due = false;
  return () => {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      draw();
    });
  };
}

/** Fit a canvas to its place, in the screen's pixels. Return {context, width, height} in CSS pixels, or null if it is not shown. */
export function fitCanvas(canvas) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return null;
  const scale = devicePixelRatio;
  const [wide, high] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Let the browser save a text as a file. */
export function download(name, text, type = "text/plain") {
  const address = URL.createObjectURL(new Blob([text], { type }));
  h("a", { href: address, download: name }).click();
  URL.revokeObjectURL(address);
}
