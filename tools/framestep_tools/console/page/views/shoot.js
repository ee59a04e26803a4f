// Shoot: one frame with motion blur. The motors wait at the start of the shutter's turn, and GO moves them through it.

import { field, h, number, read, setText } from "../dom.js";
import { M } from "../protocol.js";

const FARTHEST_FRAME = 1_000_000;
const LARGEST_ANGLE = 32767;

export class ShootView {
  title = "Shoot";
  element = h("section");
  #device;
  #operation;
  #frame = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);
  #exposure = number(1000, 0, 600_000);
  #open = number(90, -LARGEST_ANGLE, LARGEST_ANGLE);
  #close = number(270, -LARGEST_ANGLE, LARGEST_ANGLE);
  #state = h("p", { role: "status" });
  #ready = h("button", {}, "Get ready");
  #go = h("button", { type: "button", class: "main", disabled: true, onclick: () => this.#operation.go() }, "GO");
  #next = h("button", { type: "button", onclick: () => this.#step() }, "Next frame");

  constructor(device, operation) {
    this.#device = device;
    this.#operation = operation;
    this.element.append(h("article", { class: "card", "aria-label": "Shoot a frame" },
      h("h2", {}, "Shoot a frame in motion"),
      h("p", { class: "faint" }, "Motors that are set to move in a shot with motion blur (Motors, settings) go along the uploaded move from half a frame before this one to half a frame behind it: 0 to 360 degrees of the shutter. It opens and closes at these angles; exposing takes the time that is set."),
      h("form", { onsubmit: (event) => this.#prepare(event) },
        field("Frame", this.#frame), this.#next,
        field("Exposure, ms", this.#exposure), field("Shutter opens at, degrees", this.#open), field("Shutter closes at, degrees", this.#close),
        this.#ready),
      h("div", { class: "row" }, this.#go), this.#state));
  }

  connected() {
    const can = this.#device.can(M.CAP_GO_MOTION2);
    this.#ready.disabled = !can;
    if (!can) setText(this.#state, "This device does not shoot so.");
  }

  render() {
    if (this.#device.can(M.CAP_GO_MOTION2)) setText(this.#state, this.#operation.text);
    this.#go.disabled = !this.#operation.ready;
  }

  #step() {
    const frame = read(this.#frame);
    if (frame !== null) this.#frame.value = String(frame + 1);
  }

  async #prepare(event) {
    event.preventDefault();
    const [frame, exposure, open, close] = [this.#frame, this.#exposure, this.#open, this.#close].map(read);
    if ([frame, exposure, open, close].includes(null)) return;
    await this.#operation.prepare(`The shot of frame ${frame}`, "RtShootFrame2", {
      frame, exposure_ms: exposure, open_angle: open, close_angle: close, motors: [],
    });
  }
}
