// A motor's settings, read from the device when their drawer is opened.

import { check, field, h, number, positionField, read, readSteps, setText, showSteps } from "./dom.js";
import { M } from "./protocol.js";

export class MotorSettings {
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
  #at = h("output", { class: "position", "aria-live": "off" });
  #here = () => {}; // puts a limit that is chosen at the motor into its field
  #switchesKnown = false; // this page has set which limit switches belong to the motor

  /** holds: buttons that jog the motor; steps: buttons that move it by a distance. */
  constructor(device, axis, holds, steps) {
    this.#device = device;
    this.#axis = axis;
    this.#motor = axis.motor;
    const rate = (steps) => number(axis.short(axis.rate(steps)), axis.rate(1), axis.rate(4294967295), axis.scaled ? { step: "any", inputMode: "decimal" } : {});
    [this.#velocity, this.#acceleration] = [rate(5000), rate(20000)];
    [this.#lower, this.#upper] = [positionField(axis, 0), positionField(axis, 0)];
    this.#zero = positionField(axis, axis.steps(0));
    this.element = h("article", { "aria-label": `Settings of ${axis.name}`, "aria-busy": "true" },
      h("h3", {}, `${axis.motor} ${axis.settings ? axis.name : ""}`), this.#at, h("div", { class: "jogrow" }, ...holds), steps, this.#content());
    device.addEventListener("change", () => {
      if (this.element.hidden) return;
      const at = device.state.positions[axis.motor - 1];
      setText(this.#at, at === undefined ? "–" : axis.full(at));
    });
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
    return h("div", { class: "parts" },
      h("h3", {}, "Position"), form(() => this.#sendZero(), field(this.#axis.scaled ? `Call this position, ${unit}` : "Call this position", this.#zero, "nothing moves"), h("button", {}, "Set position")),
      h("h3", {}, "Soft limits on the board"), form(() => this.#sendLimits(),
        check("Lower soft limit", this.#lowerOn), h("div", { class: "pair" }, field(`Lower, ${unit}`, this.#lower), here(this.#lower)),
        check("Upper soft limit", this.#upperOn), h("div", { class: "pair" }, field(`Upper, ${unit}`, this.#upper), here(this.#upper)),
        field("Limit switch set", this.#set, "0: none. The device does not report which one is set."), check("Swap its switches", this.#swap),
        h("button", {}, "Set limits")),
      h("h3", {}, "Speed"), form(() => this.#sendSpeed(), field(`Velocity, ${unit}/s`, this.#velocity), field(`Acceleration, ${unit}/s²`, this.#acceleration), h("button", {}, "Set speed")),
      h("h3", {}, "Use"), form(() => this.#sendFlags(), check("Enabled", this.#enabled), check("Moves in a shot with motion blur", this.#blur), h("button", {}, "Set these")));
  }

  /** The fields of the limits, in the order of steps: an axis may count the other way. */
  get #ends() {
    const ends = [[this.#lowerOn, this.#lower], [this.#upperOn, this.#upper]];
    return this.#axis.perUnit < 0 ? ends.reverse() : ends;
  }

  /** Read the settings; only framestep reports them. */
  async fill() {
    this.element.setAttribute("aria-busy", "true");
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
      this.#here();
      this.#here = () => {};
      this.element.setAttribute("aria-busy", "false");
    }
  }

  async #send(request, values, done) {
    if (!(await this.#device.ask(request, { motor: this.#motor, ...values }))) return;
    this.#device.tell(`${this.#axis.title}: ${done}.`);
    await this.#device.seeSettings(this.#motor);
  }

  async #sendZero() {
    const position = readSteps(this.#axis, this.#zero);
    if (position !== null) await this.setPosition(position);
  }

  /** Call the motor's position this step. */
  async setPosition(position) {
    await this.#send("MotorResetPosition", { position }, `this position is ${this.#axis.full(position)} now`);
  }

  /** Set the lower (0) or upper (1) soft limit to the motor's position. False if this page does not know which limit switches
   * are set, as the same request sets them: then the fields are ready, and the user sends them. */
  limitHere(end) {
    const [on, input] = end === 0 ? [this.#lowerOn, this.#lower] : [this.#upperOn, this.#upper];
    const at = this.#device.state.positions[this.#motor - 1] ?? 0;
    const put = () => {
      on.checked = true;
      showSteps(this.#axis, input, at);
    };
    this.#here = put;
    if (this.#switchesKnown) this.fill().then(() => this.#sendLimits());
    return this.#switchesKnown;
  }

  async #sendLimits() {
    const [[lowOn, low], [highOn, high]] = this.#ends;
    const [lower, upper, set] = [readSteps(this.#axis, low), readSteps(this.#axis, high), read(this.#set)];
    if (lower === null || upper === null || set === null) return;
    this.#switchesKnown = true;
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
