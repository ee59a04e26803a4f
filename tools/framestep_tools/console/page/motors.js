// Motors: a line for each, the chosen one below them, and the drawers for settings and positions.

import { h, positionField, readSteps, setText, twice, wide } from "./dom.js";
import { Gamepads } from "./gamepads.js";
import { MotorBar } from "./motor_bar.js";
import { MotorSettings } from "./motor_settings.js";
import { M } from "./protocol.js";

const FARTHEST = 2_000_000_000; // target of a jog, which ends at a soft limit or when it is released
const FULL_SPEED = 10_000;
const GAMEPAD = "gamepad"; // key of its hold
const UNIT_SIZES = [0.1, 1, 10]; // distances of the step buttons, in an axis's unit
const STEP_SIZES = [1, 10, 100];
const COLORS = 12;
const MANY = 8; // more motors take shorter lines

/** The color of a motor's curve and line. */
export function color(motor) {
  return `var(--c${(motor - 1) % COLORS})`;
}

export class Motors {
  /** The drawers of this part. */
  settings = h("div");
  positions = h("div");
  #desk;
  #device;
  #holds;
  #lines = [];
  #rows;
  #panel;
  #speed;
  #speedIs;
  #homeAll;
  #asShown = twice("All are as shown", "Press again: all are known", () => this.#believe());
  #switches = new Map(); // motor -> {up: whether it stands at its upper switch, rests: whether it has been seen at rest since}

  /** desk: {device, holds, work, operation, stop, drawer(name), usable}; places: the elements of the page. */
  constructor(desk, { rows, chosen, speed, speedIs }) {
    const { device, holds, work } = desk;
    this.#desk = desk;
    this.#device = device;
    this.#holds = holds;
    [this.#rows, this.#panel, this.#speed, this.#speedIs] = [rows, chosen, speed, speedIs];
    new Gamepads({
      active: () => desk.usable && document.hasFocus() && device.connected,
      begin: (up) => this.#begin(GAMEPAD, work.chosen, up),
      end: () => holds.release(GAMEPAD),
      choose: (by) => this.choose(work.chosen + by),
      stop: desk.stop,
    });
    this.#homeAll = twice("Home all motors", "Press again: all motors move", () => device.home([]));
    device.axes.addEventListener("change", () => this.#make());
    device.addEventListener("hardstop", ({ detail: { reason, motor } }) => {
      if (reason === M.HARD_STOP_UPPER || reason === M.HARD_STOP_LOWER) this.#switches.set(motor, { up: reason === M.HARD_STOP_UPPER, rests: false });
    });
    device.addEventListener("refused", ({ detail: { code, motor } }) => {
      if (motor && (code === M.ERR_HARD_UP || code === M.ERR_HARD_LOW)) this.#switches.set(motor, { up: code === M.ERR_HARD_UP, rests: false });
    });
    speed.addEventListener("input", () => this.#showSpeed());
    this.#showSpeed();
    this.#make();
  }

  connected() {
    this.#switches.clear();
    this.choose(1);
    this.#make();
  }

  get count() {
    return this.#lines.length;
  }

  get speed() {
    return Number(this.#speed.value);
  }

  set speed(percent) {
    this.#speed.value = String(percent);
    this.#showSpeed();
  }

  /** Say which motor stands at a limit switch: {motor, up}, or null. */
  get atSwitch() {
    const [found] = this.#switches;
    return found ? { motor: found[0], up: found[1].up } : null;
  }

  /** Take the positions that are shown for those of motors whose position is lost. */
  async #believe() {
    const { lost, state } = this.#device;
    for (const motor of lost) if (!(await this.#device.ask("MotorResetPosition", { motor, position: state.positions[motor - 1] }))) return;
    this.#device.tell(`${this.#device.axes.titles(lost)}: the position is what is shown.`);
  }

  #showSpeed() {
    setText(this.#speedIs, `${this.speed} %`);
    for (const button of this.#panel.querySelectorAll("[data-speed]")) button.setAttribute("aria-pressed", String(Number(button.dataset.speed) === this.speed));
  }

  #make() {
    this.#holds.releaseAll(); // of buttons that go away
    const device = this.#device;
    const count = device.motors || Math.max(0, ...device.axes.list.map(({ motor }) => motor), ...(this.#desk.work.move?.motors ?? []));
    this.#lines = Array.from({ length: count }, (_, i) => new Line(this, this.#desk, device.axes.of(i + 1)));
    document.body.classList.toggle("many", count > MANY);
    this.#rows.replaceChildren(...this.#lines.map((line) => line.row));
    this.#panel.replaceChildren(...this.#lines.map((line) => line.panel));
    this.settings.replaceChildren(...this.#lines.map((line) => line.settings.element));
    this.#homeAll.hidden = !device.homes;
    this.positions.replaceChildren(h("p", {}, "Bring each motor to its mark with − and +, then say where it is. Nothing moves when a position is set."),
      wide("Positions", h("table", {}, h("tbody", {}, ...this.#lines.map((line) => line.positionRow)))), h("div", { class: "row" }, this.#asShown, this.#homeAll));
    this.choose(this.#desk.work.chosen);
    this.#showSpeed();
  }

  /** Choose a motor, or the nearest there is. */
  choose(motor) {
    const { work } = this.#desk;
    const before = work.chosen;
    work.chosen = Math.min(Math.max(motor, 1), Math.max(this.count, 1));
    for (const line of this.#lines) line.choose(line.motor === work.chosen);
    if (work.chosen !== before) work.dispatchEvent(new Event("chosen"));
  }

  chooseIfThere(motor) {
    if (motor <= this.count) this.choose(motor);
  }

  /** Read the chosen motor's settings: their drawer is opened. */
  fill() {
    this.#lines[this.#desk.work.chosen - 1]?.settings.fill();
  }

  render() {
    this.#asShown.disabled = !this.#device.lost.length;
    for (const [motor, at] of this.#switches) {
      if (!this.#device.moves(motor)) at.rests = true;
      else if (at.rests) this.#switches.delete(motor);
    }
    for (const line of this.#lines) line.render(this.#switches.get(line.motor)?.up);
  }

  // ---- jogs

  /** Jog the chosen motor while a key is held. */
  jog(key, up) {
    if (this.#device.connected && this.#desk.usable) this.#begin(key, this.#desk.work.chosen, up);
  }

  /** Move the chosen motor by its smallest button. */
  step(up) {
    this.#lines[this.#desk.work.chosen - 1]?.small(up);
  }

  /** Make a button that jogs a motor while it is held. */
  holdable(button, motor, up) {
    const [repeat, end] = this.#requests(motor, up);
    button.addEventListener("pointerdown", () => this.choose(motor));
    return this.#holds.button(button, `${motor} ${up}`, repeat, end);
  }

  #begin(key, motor, up) {
    this.#holds.begin(key, ...this.#requests(motor, up));
  }

  /** Return a hold's repeated request and its stop. */
  #requests(motor, up) {
    const rising = this.#device.axes.of(motor).perUnit > 0;
    const jog = async () => {
      const speed = Math.round((FULL_SPEED * this.speed) / 100);
      if (!(await this.#device.ask("MotorJog", { motor, speed, destination: up === rising ? FARTHEST : -FARTHEST }))) throw new Error("refused");
    };
    const end = () => {
      if (this.#device.client) this.#device.ask("MotorStop", { motor });
    };
    return [jog, end];
  }
}

const JOG_SPEEDS = [2, 10, 20, 60, 100];

/** One motor: its line, its panel below the lines, its drawer, its row among the positions. */
class Line {
  row;
  panel;
  settings;
  positionRow;
  #motors;
  #desk;
  #device;
  #axis;
  #bar;
  #position = h("output", { class: "pos" });
  #steps;
  #state = h("span");
  #said = h("span", { class: "c-state" });
  #trusts;
  #chip;
  #limits = [h("b"), h("b")];
  #holds = [];
  #acts = []; // buttons that are off while a run moves the rig
  #target = null; // of the last move that a step button has requested
  #asked = 0; // such moves whose answer, and whether the motor moves then, is not known yet

  constructor(motors, desk, axis) {
    this.motor = axis.motor;
    this.#motors = motors;
    this.#desk = desk;
    this.#device = desk.device;
    this.#axis = axis;
    this.#bar = new MotorBar(color(axis.motor));
    this.settings = new MotorSettings(desk.device, axis, [this.#hold(false, "Jog"), this.#hold(true, "Jog")], this.#stepButtons("Move"));
    this.row = this.#makeRow();
    this.panel = this.#makePanel();
    this.positionRow = this.#makePositionRow();
  }

  #hold(up, label = `Jog ${this.#axis.name}`) {
    const button = h("button", { type: "button", class: "hold", "aria-label": `${label} ${up ? "up" : "down"}` }, up ? "+" : "−");
    this.#holds.push([button, up]);
    return this.#motors.holdable(button, this.motor, up);
  }

  #act(text, act, props = {}) {
    const button = h("button", { type: "button", onclick: act, ...props }, text);
    this.#acts.push(button);
    return button;
  }

  #makeRow() {
    const axis = this.#axis;
    const line = h("i", { "aria-hidden": "true" });
    line.style.background = color(this.motor);
    this.#chip = h("button", {
      type: "button",
      class: "chip",
      "aria-pressed": "false",
      "aria-label": `Choose motor ${this.motor}${axis.settings ? `, ${axis.name}` : ""}`,
    }, String(this.motor), line);
    this.#chip.addEventListener("click", (event) => {
      event.stopPropagation();
      if (this.#desk.work.chosen === this.motor && this.#desk.narrow) this.#desk.drawer("motor");
      this.#motors.choose(this.motor);
    });
    this.#position.setAttribute("aria-label", `Position of ${axis.name} in ${axis.unit}`);
    this.#position.setAttribute("aria-live", "off");
    this.#steps = axis.scaled ? h("output", { class: "unseen", "aria-label": `Position of motor ${this.motor} in steps`, "aria-live": "off" }) : this.#position;
    if (!axis.scaled) this.#position.setAttribute("aria-label", `Position of motor ${this.motor} in steps`);
    return h("li", { "aria-label": axis.title, onclick: () => this.#motors.choose(this.motor) },
      this.#chip, h("div", { class: "name" }, h("b", {}, axis.title), this.#state),
      h("div", { class: "at" }, this.#position, axis.scaled ? this.#steps : h("small", {}, " steps")),
      this.#bar.element, this.#hold(false), this.#hold(true));
  }

  #makePanel() {
    const axis = this.#axis;
    const device = this.#device;
    const target = positionField(axis, axis.scaled ? axis.steps(0) : 0);
    target.setAttribute("aria-label", axis.scaled ? `Move to, ${axis.unit}` : "Move to step");
    const move = async (event) => {
      event.preventDefault();
      const position = readSteps(axis, target);
      if (position !== null) await this.#moveTo(position);
    };
    const here = (text, end) => this.#act(text, () => {
      if (!this.settings.limitHere(end)) this.#desk.drawer("motor");
    }, { "aria-label": `${text}: soft limit of ${axis.name}` });
    const go = h("button", { class: "main" }, "Move");
    this.#acts.push(go);
    const speeds = JOG_SPEEDS.map((percent) => h("button", { type: "button", "data-speed": percent, onclick: () => { this.#motors.speed = percent; } }, `${percent}${percent === JOG_SPEEDS[0] ? " %" : ""}`));
    return h("article", { class: "of-motor", "aria-label": axis.title },
      h("div", { class: "r1" }, h("b", { class: "c-name" }, `${this.motor} ${axis.settings ? axis.name : ""}`), this.#said,
        h("button", { type: "button", hidden: !device.homes, "aria-label": `Home ${axis.name}`, onclick: () => device.home([this.motor]) }, "Home"),
        h("button", { type: "button", class: "stop-one", title: "Stop this motor", onclick: () => device.ask("MotorStop", { motor: this.motor }) }, "Stop it"),
        h("button", { type: "button", onclick: () => this.#desk.drawer("motor") }, "Settings…")),
      h("div", { class: "pad" }, this.#hold(false), h("div", { class: "seg fine", role: "group", "aria-label": "Jog speed" }, ...speeds), this.#hold(true)),
      this.#stepButtons(),
      h("form", { class: "r3", onsubmit: move }, h("span", {}, "Move to"), target, go, h("span", { class: "grow" }),
        this.#act("Zero here", () => this.settings.setPosition(axis.scaled ? axis.steps(0) : 0), { class: "zero", title: `Calls this position 0 ${axis.unit}; nothing moves` }),
        h("button", { type: "button", class: "few", onclick: () => this.#desk.drawer("motor") }, "Settings…")),
      h("div", { class: "r4" }, h("span", {}, "Limits ", this.#limits[0]), here("Lower here", 0), h("span", {}, "to ", this.#limits[1]), here("Upper here", 1)));
  }

  #makePositionRow() {
    const axis = this.#axis;
    const field = positionField(axis, axis.scaled ? axis.steps(0) : 0, { "aria-label": `Call ${axis.name} here` });
    this.#trusts = h("span");
    return h("tr", {}, h("th", { scope: "row" }, `${this.motor} ${axis.settings ? axis.name : ""}`, h("br"), this.#trusts),
      h("td", {}, this.#hold(false, axis.name), " ", this.#hold(true, axis.name)),
      h("td", {}, field), h("td", {}, this.#act("Set", () => {
        const steps = readSteps(axis, field);
        if (steps !== null) this.settings.setPosition(steps);
      }, { "aria-label": `Set position of ${axis.name}` })));
  }

  choose(on) {
    this.row.classList.toggle("chosen", on);
    this.#chip.setAttribute("aria-pressed", String(on));
    this.panel.hidden = !on;
    this.settings.element.hidden = !on;
  }

  /** atSwitch: whether it stands at its upper switch; undefined at none. */
  render(atSwitch) {
    const { work, operation } = this.#desk;
    const device = this.#device;
    const axis = this.#axis;
    const steps = device.state.positions[this.motor - 1];
    const known = steps !== undefined;
    setText(this.#steps, known ? String(steps) : "–");
    setText(this.#position, known ? (axis.scaled ? axis.text(steps) : String(steps)) : "–");
    const checked = work.checked.find(({ motor }) => motor === this.motor);
    this.#bar.show(axis, device.limitsOf(this.motor), checked ? [checked.need.lowest, checked.need.highest] : null, steps, work.at(this.motor, work.see));
    const trust = device.trustOf(this.motor);
    const moves = device.moves(this.motor) && device.knowsWhatMoves;
    const bad = atSwitch !== undefined ? `${atSwitch ? "upper" : "lower"} switch` : checked?.misfits.length ? "does not fit" : "";
    const state = !device.connected ? (this.#desk.blind ? "not known" : "") : !device.knowsWhatMoves ? "not known" : moves ? "moves" : bad || (trust && trust.state !== "known" ? trust.state : "at rest");
    setText(this.#state, state);
    const row = this.row.classList;
    row.toggle("is-moving", moves);
    row.toggle("is-bad", bad !== "" && !moves);
    row.toggle("is-lost", trust?.state === "lost");
    row.toggle("is-held", trust?.state === "held");
    row.toggle("atlimit", atSwitch !== undefined);
    const shown = [axis.scaled && known ? `${steps} steps` : "", trust ? `position ${trust.text}` : ""].filter(Boolean).join(", ");
    setText(this.#said, shown);
    this.#said.title = shown;
    this.#trusts.className = trust?.state ?? "faint";
    setText(this.#trusts, trust ? trust.text : "");
    const ends = axis.limits ?? device.limitsOf(this.motor);
    const [low, high] = ends ? (axis.perUnit < 0 ? [ends[1], ends[0]] : ends) : [];
    setText(this.#limits[0], ends ? axis.brief(low) : "none");
    setText(this.#limits[1], ends ? axis.withUnit(axis.brief(high)) : "none");
    const off = !this.#desk.usable || operation.busy || work.uploading !== null;
    for (const [button, up] of this.#holds) button.disabled = off || atSwitch === up;
    for (const button of this.#acts) button.disabled = off;
  }

  // ---- moves by a distance

  /** Buttons that move by a fixed distance. */
  #stepButtons(label = `Move ${this.#axis.name}`) {
    const sizes = this.#axis.scaled ? UNIT_SIZES.filter((size) => size * Math.abs(this.#axis.perUnit) >= 1) : STEP_SIZES;
    const button = (by) => this.#act(signed(by), () => this.#moveBy(by), { class: "by", "aria-label": `${label} by ${this.#axis.withUnit(signed(by))}` });
    return h("div", { class: "r2" }, ...[...sizes].reverse().map((size) => button(-size)), ...sizes.map(button));
  }

  small(up) {
    const sizes = this.#axis.scaled ? UNIT_SIZES.filter((size) => size * Math.abs(this.#axis.perUnit) >= 1) : STEP_SIZES;
    if (this.#desk.usable) this.#moveBy((up ? 1 : -1) * (sizes[0] ?? 1));
  }

  /** Several presses add up, also while the motor moves. */
  async #moveBy(distance) {
    const at = this.#device.state.positions[this.motor - 1];
    if (at === undefined) return;
    const from = this.#asked || this.#device.moves(this.motor) ? this.#target ?? at : at;
    this.#target = from + Math.round(distance * this.#axis.perUnit);
    this.#asked += 1;
    await this.#moveTo(this.#target);
    await this.#device.seeWhatMoves();
    this.#asked -= 1;
  }

  async #moveTo(position) {
    const beyond = this.#axis.scaled ? this.#axis.beyond(position) : null;
    if (beyond) this.#device.tell(`${beyond}.`, true);
    else await this.#device.ask("MotorMove", { motor: this.motor, position });
  }
}

function signed(number) {
  return number < 0 ? `−${-number}` : `+${number}`;
}
