// Motors: positions, jog, move, zero, home, soft limits, speed.

import { check, field, h, number, positionField, read, readSteps, setText, showSteps } from "../dom.js";
import { Gamepads } from "../gamepads.js";
import { PositionBar } from "../position_bar.js";
import { M } from "../protocol.js";

const FARTHEST = 2_000_000_000; // target of a jog, which ends at a soft limit or when it is released
const FULL_SPEED = 10_000;
const GAMEPAD = "gamepad"; // key of its hold
const UNIT_SIZES = [0.1, 1, 10]; // distances of the step buttons, in an axis's unit
const STEP_SIZES = [1, 10, 100];

export class MotorsView {
  title = "Motors";
  element = h("section");
  #device;
  #holds;
  #cards = [];
  #list = h("div", { class: "cards" });
  #speed = h("input", { type: "range", min: "1", max: "100", value: "20" });
  #homeAll = h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#device.home([]) }, "Home all motors"));
  #chosen = 1;

  /** stop: stops everything. */
  constructor(device, holds, stop) {
    this.#device = device;
    this.#holds = holds;
    new Gamepads({
      active: () => !this.element.hidden && !this.element.inert && document.hasFocus() && device.connected,
      begin: (up) => this.#jog(GAMEPAD, this.#chosen, up),
      end: () => holds.release(GAMEPAD),
      choose: (by) => this.#choose(Math.min(Math.max(this.#chosen + by, 1), this.#cards.length)),
      stop,
    });
    device.axes.addEventListener("change", () => this.#makeCards());
    const shown = h("output");
    const tell = () => setText(shown, `${this.#speed.value} % of each motor's own`);
    this.#speed.addEventListener("input", tell);
    tell();
    this.element.append(
      h("div", { class: "card" }, h("div", { class: "row" }, field("Jog speed", this.#speed), shown),
        h("p", { class: "faint" }, "Hold − or + to jog.", h("span", { class: "keys" }, " Keys: 1 to 9 choose a motor, ← and → jog the chosen one as long as they are held. Game controller: L1 or R1 and the left stick; its cross chooses, B stops."))),
      this.#homeAll,
      this.#list,
    );
  }

  connected() {
    this.#homeAll.hidden = !this.#device.homes;
    this.#chosen = 1;
    this.#makeCards();
  }

  #makeCards() {
    this.#holds.releaseAll(); // of buttons that go away
    this.#cards = [];
    for (let motor = 1; motor <= this.#device.motors; motor += 1) {
      this.#cards.push(new MotorCard(this.#device, this.#device.axes.of(motor), {
        hold: (button, up) => this.#holdable(button, motor, up),
        choose: () => this.#choose(motor),
      }));
    }
    this.#list.replaceChildren(...this.#cards.map((card) => card.element));
    this.#choose(this.#chosen);
  }

  render() {
    for (const card of this.#cards) card.render();
  }

  keydown(event) {
    if (/^[1-9]$/.test(event.key) && Number(event.key) <= this.#cards.length) this.#choose(Number(event.key));
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    event.preventDefault();
    if (!event.repeat && this.#device.connected) this.#jog(event.key, this.#chosen, event.key === "ArrowRight");
  }

  keyup(event) {
    this.#holds.release(event.key);
  }

  #choose(motor) {
    this.#chosen = motor;
    for (const card of this.#cards) card.choose(card.motor === motor);
  }

  #holdable(button, motor, up) {
    const [repeat, end] = this.#requests(motor, up);
    return this.#holds.button(button, `${motor} ${up}`, repeat, end);
  }

  #jog(key, motor, up) {
    this.#holds.begin(key, ...this.#requests(motor, up));
  }

  /** Return a hold's repeated request and its stop. */
  #requests(motor, up) {
    const rising = this.#device.axes.of(motor).perUnit > 0;
    const jog = async () => {
      const speed = Math.round((FULL_SPEED * Number(this.#speed.value)) / 100);
      try {
        await this.#device.demand("MotorJog", { motor, speed, destination: up === rising ? FARTHEST : -FARTHEST });
      } catch (error) {
        this.#device.tell(error.message, true);
        throw error;
      }
    };
    const end = () => {
      if (this.#device.client) this.#device.ask("MotorStop", { motor });
    };
    return [jog, end];
  }
}

/** One motor. */
class MotorCard {
  #device;
  #axis;
  #position = h("output", { class: "position" });
  #steps = h("output", { class: "faint" });
  #state = h("span", { class: "faint" });
  #trust = h("span");
  #bar = new PositionBar();
  #name;
  #target = null; // of the last move that a step button has requested
  #asked = 0; // such moves whose answer, and whether the motor moves then, is not known yet

  constructor(device, axis, { hold, choose }) {
    this.motor = axis.motor;
    this.#axis = axis;
    this.#device = device;
    this.#name = h("button", { type: "button", "aria-pressed": "false", onclick: choose }, axis.title);
    const inSteps = axis.scaled ? this.#steps : this.#position;
    this.#position.setAttribute("aria-label", `Position of ${axis.name} in ${axis.unit}`);
    inSteps.setAttribute("aria-label", `Position of motor ${this.motor} in steps`);
    const down = hold(h("button", { type: "button", class: "hold", "aria-label": `Jog ${axis.name} down` }, "−"), false);
    const up = hold(h("button", { type: "button", class: "hold", "aria-label": `Jog ${axis.name} up` }, "+"), true);
    this.element = h("article", { class: "card", "aria-label": axis.title },
      h("div", { class: "row spread" }, this.#name, axis.settings ? h("span", { class: "faint" }, `motor ${this.motor}`) : null, this.#state),
      h("div", {}, this.#position, " ", ...(axis.scaled ? [this.#steps, h("span", { class: "unit" }, " steps")] : [h("span", { class: "unit" }, "steps")])),
      this.#bar.element,
      this.#trust,
      h("div", { class: "row" }, down, up,
        h("button", { type: "button", hidden: !device.homes, "aria-label": `Home ${axis.name}`, onclick: () => device.home([this.motor]) }, "Home")),
      this.#stepButtons(),
      this.#moveForm(),
      new MotorSettings(device, axis).element);
  }

  choose(on) {
    this.element.classList.toggle("chosen", on);
    this.#name.setAttribute("aria-pressed", String(on));
  }

  render() {
    const steps = this.#device.state.positions[this.motor - 1];
    const known = steps !== undefined;
    setText(this.#steps, known ? String(steps) : "–");
    setText(this.#position, known ? (this.#axis.scaled ? this.#axis.text(steps) : String(steps)) : "–");
    const moves = this.#device.moves(this.motor) ? "moves" : "at rest";
    setText(this.#state, this.#device.knowsWhatMoves ? moves : "not known");
    const trust = this.#device.trustOf(this.motor);
    this.#trust.className = trust?.state ?? "";
    setText(this.#trust, trust ? `Position ${trust.text}` : "");
    this.#bar.show(this.#axis, this.#device.limitsOf(this.motor), steps);
  }

  /** Buttons that move by a fixed distance. */
  #stepButtons() {
    const sizes = this.#axis.scaled ? UNIT_SIZES.filter((size) => size * Math.abs(this.#axis.perUnit) >= 1) : STEP_SIZES;
    const button = (by) => h("button", {
      type: "button",
      class: "by",
      "aria-label": `Move ${this.#axis.name} by ${this.#axis.withUnit(signed(by))}`,
      onclick: () => this.#moveBy(by),
    }, signed(by));
    return h("div", { class: "row steps" }, ...[...sizes].reverse().map((size) => button(-size)), ...sizes.map(button));
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

  #moveForm() {
    const target = positionField(this.#axis, this.#axis.scaled ? this.#axis.steps(0) : 0);
    const move = async (event) => {
      event.preventDefault();
      const position = readSteps(this.#axis, target);
      if (position !== null) await this.#moveTo(position);
    };
    return h("form", { onsubmit: move },
      field(this.#axis.scaled ? `Move to, ${this.#axis.unit}` : "Move to step", target),
      h("button", { class: "main" }, "Move"),
      h("button", { type: "button", onclick: () => this.#device.ask("MotorStop", { motor: this.motor }) }, "Stop this motor"));
  }
}

function signed(number) {
  return number < 0 ? `−${-number}` : `+${number}`;
}

/** A motor's settings, read from the device when they are opened. */
class MotorSettings {
  #device;
  #axis;
  #motor;
  #velocity;
  #acceleration;
  #lowerOn = h("input");
  #lower;
  #upperOn = h("input");
  #upper;
  #set = number(0, 0, M.HW_SET_MASK);
  #swap = h("input");
  #zero;
  #enabled = h("input", { checked: true });
  #blur = h("input");

  constructor(device, axis) {
    this.#device = device;
    this.#axis = axis;
    this.#motor = axis.motor;
    const rate = (steps) => number(axis.short(axis.rate(steps)), axis.rate(1), axis.rate(4294967295), axis.scaled ? { step: "any", inputMode: "decimal" } : {});
    [this.#velocity, this.#acceleration] = [rate(5000), rate(20000)];
    [this.#lower, this.#upper] = [positionField(axis, 0), positionField(axis, 0)];
    this.#zero = positionField(axis, axis.steps(0));
    this.element = h("details", {}, h("summary", {}, "Zero, soft limits, speed"), this.#content());
    this.element.setAttribute("aria-busy", "true"); // while it is closed as well: the event of opening comes later
    this.element.addEventListener("toggle", () => (this.element.open ? this.#fill() : this.element.setAttribute("aria-busy", "true")));
  }

  #content() {
    const { unit } = this.#axis;
    const here = (input) => h("button", {
      type: "button",
      onclick: () => showSteps(this.#axis, input, this.#device.state.positions[this.#motor - 1] ?? 0),
    }, "Here");
    const form = (send, ...parts) => h("form", {
      onsubmit: (event) => {
        event.preventDefault();
        send();
      },
    }, ...parts);
    return h("div", {},
      form(() => this.#sendZero(), field(this.#axis.scaled ? `Call this position, ${unit}` : "Call this position", this.#zero, "nothing moves"), h("button", {}, "Set position")),
      form(() => this.#sendLimits(),
        check("Lower soft limit", this.#lowerOn), h("div", { class: "pair" }, field(`Lower, ${unit}`, this.#lower), here(this.#lower)),
        check("Upper soft limit", this.#upperOn), h("div", { class: "pair" }, field(`Upper, ${unit}`, this.#upper), here(this.#upper)),
        field("Limit switch set", this.#set, "0: none. The device does not report which one is set."), check("Swap its switches", this.#swap),
        h("button", {}, "Set limits")),
      form(() => this.#sendSpeed(), field(`Velocity, ${unit}/s`, this.#velocity), field(`Acceleration, ${unit}/s²`, this.#acceleration), h("button", {}, "Set speed")),
      form(() => this.#sendFlags(), check("Enabled", this.#enabled), check("Moves in a shot with motion blur", this.#blur), h("button", {}, "Set these")));
  }

  /** The fields of the limits, in the order of steps: an axis may count the other way. */
  get #ends() {
    const ends = [[this.#lowerOn, this.#lower], [this.#upperOn, this.#upper]];
    return this.#axis.perUnit < 0 ? ends.reverse() : ends;
  }

  /** Read the settings; only framestep reports them. */
  async #fill() {
    // what is typed before the answer comes is overwritten
    try {
      const reported = await this.#device.demand("GetExceeded", { motor: this.#motor });
      if (reported.velocity === undefined) return;
      this.#velocity.value = this.#axis.short(this.#axis.rate(reported.velocity));
      this.#acceleration.value = this.#axis.short(this.#axis.rate(reported.acceleration));
      const [[lowOn, low], [highOn, high]] = this.#ends;
      showSteps(this.#axis, low, reported.lower);
      showSteps(this.#axis, high, reported.upper);
      lowOn.checked = (reported.bits & M.SET_LOWER) !== 0;
      highOn.checked = (reported.bits & M.SET_UPPER) !== 0;
      this.#enabled.checked = (reported.bits & M.SET_ENABLED) !== 0;
    } catch {
      this.#device.tell("This device does not report its settings; the fields show defaults.");
    } finally {
      this.element.setAttribute("aria-busy", "false");
    }
  }

  async #send(request, values, done) {
    if (!(await this.#device.ask(request, { motor: this.#motor, ...values }))) return;
    this.#device.tell(`${this.#axis.title}: ${done}.`);
    await this.#device.seeLimits(this.#motor);
  }

  async #sendZero() {
    const position = readSteps(this.#axis, this.#zero);
    if (position !== null) await this.#send("MotorResetPosition", { position }, `this position is ${this.#axis.full(position)} now`);
  }

  async #sendLimits() {
    const [[lowOn, low], [highOn, high]] = this.#ends;
    const [lower, upper, set] = [readSteps(this.#axis, low), readSteps(this.#axis, high), read(this.#set)];
    if (lower === null || upper === null || set === null) return;
    await this.#send("MotorSetLimits", {
      lower_enable: Number(lowOn.checked),
      lower,
      upper_enable: Number(highOn.checked),
      upper,
      limit_set: set | (this.#swap.checked ? M.HW_SET_SWAP : 0),
    }, "limits are set");
  }

  async #sendSpeed() {
    const [velocity, acceleration] = [read(this.#velocity), read(this.#acceleration)];
    if (velocity === null || acceleration === null) return;
    const [steps, more] = [velocity, acceleration].map((rate) => this.#axis.rateSteps(rate));
    await this.#send("MotorSetSpeed", { velocity: steps, acceleration: more }, "speed is set");
  }

  async #sendFlags() {
    const flags = (this.#enabled.checked ? M.MOTOR_ENABLED : 0) | (this.#blur.checked ? M.MOTOR_BLUR : 0);
    await this.#send("MotorConfigure", { flags }, this.#enabled.checked ? "on" : "off");
  }
}
