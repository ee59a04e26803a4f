// Motors: positions, jog, move, zero, home, soft limits, speed.

import { check, field, h, number, read, setText } from "../dom.js";
import { M } from "../protocol.js";

const FARTHEST = 2_000_000_000; // target of a jog, which ends at a soft limit or when it is released
const FULL_SPEED = 10_000;
const LOWEST = -2147483648;
const HIGHEST = 2147483647;

export class MotorsView {
  title = "Motors";
  element = h("section");
  #device;
  #holds;
  #cards = [];
  #list = h("div", { class: "cards" });
  #speed = h("input", { type: "range", min: "1", max: "100", value: "20" });
  #homeAll = h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#device.ask("Home", { motors: [] }) }, "Home all motors"));
  #chosen = 1;

  constructor(device, holds) {
    this.#device = device;
    this.#holds = holds;
    const shown = h("output");
    const tell = () => setText(shown, `${this.#speed.value} % of each motor's own`);
    this.#speed.addEventListener("input", tell);
    tell();
    this.element.append(
      h("div", { class: "card" }, field("Jog speed", this.#speed), shown,
        h("p", { class: "faint" }, "Hold − or + to jog. Keys: 1 to 9 choose a motor, ← and → jog the chosen one as long as they are held.")),
      this.#homeAll,
      this.#list,
    );
  }

  connected() {
    this.#homeAll.hidden = !this.#device.homes;
    this.#cards = [];
    for (let motor = 1; motor <= this.#device.motors; motor += 1) {
      this.#cards.push(new MotorCard(this.#device, motor, {
        hold: (button, up) => this.#holdable(button, motor, up),
        choose: () => this.#choose(motor),
      }));
    }
    this.#list.replaceChildren(...this.#cards.map((card) => card.element));
    this.#choose(1);
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
    const jog = async () => {
      const speed = Math.round((FULL_SPEED * Number(this.#speed.value)) / 100);
      try {
        await this.#device.demand("MotorJog", { motor, speed, destination: up ? FARTHEST : -FARTHEST });
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
  #position = h("output", { class: "position" });
  #state = h("span", { class: "faint" });
  #trust = h("span");
  #name;
  #settings;

  constructor(device, motor, { hold, choose }) {
    this.motor = motor;
    this.#device = device;
    this.#name = h("button", { type: "button", "aria-pressed": "false", onclick: choose }, `Motor ${motor}`);
    this.#position.setAttribute("aria-label", `Position of motor ${motor} in steps`);
    this.#settings = new MotorSettings(device, motor);
    const down = hold(h("button", { type: "button", class: "hold", "aria-label": `Jog motor ${motor} down` }, "−"), false);
    const up = hold(h("button", { type: "button", class: "hold", "aria-label": `Jog motor ${motor} up` }, "+"), true);
    this.element = h("article", { class: "card", "aria-label": `Motor ${motor}` },
      h("div", { class: "row spread" }, this.#name, this.#state),
      h("div", {}, this.#position, " ", h("span", { class: "unit" }, "steps")),
      this.#trust,
      h("div", { class: "row" }, down, up,
        h("button", { type: "button", hidden: !device.homes, "aria-label": `Home motor ${motor}`, onclick: () => device.ask("Home", { motors: [motor] }) }, "Home")),
      this.#moveForm(),
      this.#settings.element);
  }

  choose(on) {
    this.element.classList.toggle("chosen", on);
    this.#name.setAttribute("aria-pressed", String(on));
  }

  render() {
    const position = this.#device.state.positions[this.motor - 1];
    setText(this.#position, position === undefined ? "–" : String(position));
    const moves = this.#device.moves(this.motor) ? "moves" : "at rest";
    setText(this.#state, this.#device.knowsWhatMoves ? moves : "not known");
    const trust = this.#device.trustOf(this.motor);
    this.#trust.className = trust?.state ?? "";
    setText(this.#trust, trust ? `Position ${trust.text}` : "");
  }

  #moveForm() {
    const target = number(0, LOWEST, HIGHEST);
    const move = async (event) => {
      event.preventDefault();
      const position = read(target);
      if (position !== null) await this.#device.ask("MotorMove", { motor: this.motor, position });
    };
    return h("form", { onsubmit: move },
      field("Move to step", target),
      h("button", { class: "main" }, "Move"),
      h("button", { type: "button", onclick: () => this.#device.ask("MotorStop", { motor: this.motor }) }, "Stop this motor"));
  }
}

/** A motor's settings, read from the device when they are opened. */
class MotorSettings {
  #device;
  #motor;
  #velocity = number(5000, 1, 4294967295);
  #acceleration = number(20000, 1, 4294967295);
  #lowerOn = h("input");
  #lower = number(0, LOWEST, HIGHEST);
  #upperOn = h("input");
  #upper = number(0, LOWEST, HIGHEST);
  #set = number(0, 0, M.HW_SET_MASK);
  #swap = h("input");
  #zero = number(0, LOWEST, HIGHEST);
  #enabled = h("input", { checked: true });
  #blur = h("input");

  constructor(device, motor) {
    this.#device = device;
    this.#motor = motor;
    this.element = h("details", {}, h("summary", {}, "Zero, soft limits, speed"), this.#content());
    this.element.addEventListener("toggle", () => this.element.open && this.#fill());
  }

  #content() {
    const here = (input) => h("button", {
      type: "button",
      onclick: () => {
        input.value = String(this.#device.state.positions[this.#motor - 1] ?? 0);
      },
    }, "Here");
    const form = (send, ...parts) => h("form", {
      onsubmit: (event) => {
        event.preventDefault();
        send();
      },
    }, ...parts);
    return h("div", {},
      form(() => this.#sendZero(), field("Call this position", this.#zero, "0 is zero; nothing moves"), h("button", {}, "Set position")),
      form(() => this.#sendLimits(),
        check("Lower soft limit", this.#lowerOn), field("Lower, steps", this.#lower), here(this.#lower),
        check("Upper soft limit", this.#upperOn), field("Upper, steps", this.#upper), here(this.#upper),
        field("Limit switch set", this.#set, "0: none. The device does not report which one is set."), check("Swap its switches", this.#swap),
        h("button", {}, "Set limits")),
      form(() => this.#sendSpeed(), field("Velocity, steps/s", this.#velocity), field("Acceleration, steps/s²", this.#acceleration), h("button", {}, "Set speed")),
      form(() => this.#sendFlags(), check("Enabled", this.#enabled), check("Moves in a shot with motion blur", this.#blur), h("button", {}, "Set")));
  }

  /** Read the settings; only framestep reports them. */
  async #fill() {
    try {
      const told = await this.#device.demand("GetExceeded", { motor: this.#motor });
      if (told.velocity === undefined) return;
      this.#velocity.value = String(told.velocity);
      this.#acceleration.value = String(told.acceleration);
      this.#lower.value = String(told.lower);
      this.#upper.value = String(told.upper);
      this.#lowerOn.checked = (told.bits & M.SET_LOWER) !== 0;
      this.#upperOn.checked = (told.bits & M.SET_UPPER) !== 0;
      this.#enabled.checked = (told.bits & M.SET_ENABLED) !== 0;
    } catch {
      this.#device.tell("This device does not report its settings; the fields show defaults.");
    }
  }

  async #send(request, values, done) {
    if (await this.#device.ask(request, { motor: this.#motor, ...values })) this.#device.tell(`Motor ${this.#motor}: ${done}.`);
  }

  async #sendZero() {
    const position = read(this.#zero);
    if (position !== null) await this.#send("MotorResetPosition", { position }, `this position is ${position} now`);
  }

  async #sendLimits() {
    const [lower, upper, set] = [read(this.#lower), read(this.#upper), read(this.#set)];
    if (lower === null || upper === null || set === null) return;
    await this.#send("MotorSetLimits", {
      lower_enable: Number(this.#lowerOn.checked),
      lower,
      upper_enable: Number(this.#upperOn.checked),
      upper,
      limit_set: set | (this.#swap.checked ? M.HW_SET_SWAP : 0),
    }, "limits are set");
  }

  async #sendSpeed() {
    const [velocity, acceleration] = [read(this.#velocity), read(this.#acceleration)];
    if (velocity !== null && acceleration !== null) await this.#send("MotorSetSpeed", { velocity, acceleration }, "speed is set");
  }

  async #sendFlags() {
    const flags = (this.#enabled.checked ? M.MOTOR_ENABLED : 0) | (this.#blur.checked ? M.MOTOR_BLUR : 0);
    await this.#send("MotorConfigure", { flags }, this.#enabled.checked ? "on" : "off");
  }
}
