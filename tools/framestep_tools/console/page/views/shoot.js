// Shoot: one frame with motion blur, or many at their times. The motors wait at the start of the shutter's turn, and GO
// moves them through it.

import { field, h, number, read, setText } from "../dom.js";
import { M } from "../protocol.js";

const FARTHEST_FRAME = 1_000_000;
const LARGEST_ANGLE = 32767;
const LONGEST_INTERVAL = 86_400; // s

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
  #series;
  #from = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);
  #to = number(48, -FARTHEST_FRAME, FARTHEST_FRAME);
  #interval = number(10, 0, LONGEST_INTERVAL, { step: "any", inputMode: "decimal" });
  #all = h("button", { class: "main" }, "Shoot them");

  constructor(device, operation, series) {
    this.#device = device;
    this.#operation = operation;
    this.#series = series;
    this.element.append(h("article", { class: "card", "aria-label": "Shoot a frame" },
      h("h2", {}, "Shoot a frame in motion"),
      h("p", { class: "faint" }, "Motors that are set to move in a shot with motion blur (Motors, settings) go along the uploaded move from half a frame before this one to half a frame behind it: 0 to 360 degrees of the shutter. It opens and closes at these angles; exposing takes the time that is set."),
      h("form", { onsubmit: (event) => this.#prepare(event) },
        field("Frame", this.#frame), this.#next,
        field("Exposure, ms", this.#exposure), field("Shutter opens at, degrees", this.#open), field("Shutter closes at, degrees", this.#close),
        this.#ready),
      h("div", { class: "row" }, this.#go), this.#state),
    h("article", { class: "card", "aria-label": "Timelapse" },
      h("h2", {}, "Timelapse"),
      h("p", { class: "faint" }, "Shoots frames of the uploaded move one after another, with the exposure and the shutter's angles above. Between two pictures the rig goes to the next frame. Motors that are not set to move in a shot rest during the exposure. STOP ends it."),
      h("form", { onsubmit: (event) => this.#shootAll(event) },
        field("From frame", this.#from), field("To frame", this.#to, "before the first: backward"),
        field("Seconds from picture to picture", this.#interval), this.#all)));
  }

  connected() {
    const can = this.#device.can(M.CAP_GO_MOTION2);
    if (!can) setText(this.#state, "This device does not shoot so.");
  }

  render() {
    if (this.#device.can(M.CAP_GO_MOTION2)) setText(this.#state, this.#operation.text);
    this.#go.disabled = !this.#operation.ready || this.#series.goesOn;
    this.#ready.disabled = this.#all.disabled = !this.#device.can(M.CAP_GO_MOTION2) || this.#series.goesOn;
  }

  #step() {
    const frame = read(this.#frame);
    if (frame !== null) this.#frame.value = String(frame + 1);
  }

  async #prepare(event) {
    event.preventDefault();
    const frame = read(this.#frame);
    const shot = this.#shot();
    if (frame === null || !shot) return;
    await this.#operation.prepare(`The shot of frame ${frame}`, "RtShootFrame2", { frame, ...shot });
  }

  /** Return what is the same for every shot, or null for a wrong field. */
  #shot() {
    const [exposure, open, close] = [this.#exposure, this.#open, this.#close].map(read);
    if ([exposure, open, close].includes(null)) return null;
    return { exposure_ms: exposure, open_angle: open, close_angle: close, motors: [] };
  }

  async #shootAll(event) {
    event.preventDefault();
    const [from, to, seconds] = [this.#from, this.#to, this.#interval].map(read);
    const shot = this.#shot();
    if ([from, to, seconds].includes(null) || !shot) return;
    const step = to < from ? -1 : 1;
    const frames = Array.from({ length: Math.abs(to - from) + 1 }, (_, i) => from + step * i);
    await this.#series.shoot(frames, seconds * 1000, (frame) => ({ frame, ...shot }));
  }
}
