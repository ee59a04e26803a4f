// Step 5: the first move, there and back.

import { field, h, number, read, setText } from "framestep-console/dom.js";

const FAR = 1600; // steps: half a turn of a motor with 16 microsteps
const FARTHEST = 1_000_000;
const LOOK_MS = 50;

export class FirstMoveStep {
  title = "5. First move";
  element = h("section");
  #device;
  #motor = h("select");
  #far = number(FAR, 1, FARTHEST);
  #said = h("p", { role: "status" });
  #go = h("button", { type: "submit", class: "main" }, "Move there and back");

  constructor(device) {
    this.#device = device;
    const move = (event) => {
      event.preventDefault();
      this.#run();
    };
    this.element.append(
      h("article", { class: "card", "aria-label": "First move" }, h("h2", {}, "The first move"),
        h("p", {}, "The motor moves on its own now, with its ramps. STOP or Escape ends it."),
        h("form", { onsubmit: move }, field("Motor", this.#motor), field("Distance, steps", this.#far), this.#go), this.#said),
      h("article", { class: "card", "aria-label": "What next" }, h("h2", {}, "What next"),
        h("p", {}, "Put the load on. Velocity, soft limits and the limit switches of a motor come from Dragonframe or from ", h("code", {}, "framestep console"), ": until then no limit switch stops a motor."),
        h("p", {}, "In Dragonframe: Scene > Connections > Add Connection > “dmc-lite (or any DMC device)”, port “framestep DMC”. Close this page first: one program at a time has the port.")));
  }

  connected() {
    this.#motor.replaceChildren(...Array.from({ length: this.#device.motors }, (_, i) => h("option", { value: i + 1 }, `Motor ${i + 1}`)));
  }

  render() {}

  async #run() {
    const far = read(this.#far);
    const motor = Number(this.#motor.value);
    if (far === null) return;
    this.#go.disabled = true;
    try {
      const begin = await this.#position(motor);
      for (const target of [begin + far, begin]) {
        setText(this.#said, `Motor ${motor} goes to ${target}.`);
        const at = await this.#move(motor, target);
        if (at !== target) {
          setText(this.#said, `Motor ${motor} was stopped at ${at}.`);
          return;
        }
      }
      setText(this.#said, `Motor ${motor} went ${far} steps and is back at ${begin}. That was the first move.`);
    } catch (error) {
      setText(this.#said, error.message);
    } finally {
      this.#go.disabled = false;
    }
  }

  /** Move a motor; return its position at rest. */
  async #move(motor, position) {
    await this.#device.demand("MotorMove", { motor, position });
    for (;;) {
      await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
      const { motor_bits: moving } = await this.#device.demand("MotorStatus");
      if (!((moving >>> (motor - 1)) & 1)) return this.#position(motor);
    }
  }

  async #position(motor) {
    return (await this.#device.demand("MotorGetPosition")).steps[motor - 1];
  }
}
