// Options of a run: the camera, and the bloop, a moment of light or sound at the first frame.

import { field, h, number, read } from "./dom.js";
import { M } from "./protocol.js";

const CAMERAS = [["none", 0], ["video: a pulse at GO and one at the end", M.RUN_VIDEO], ["stills: a pulse at each frame", M.RUN_STILLS]];
const LONGEST_BLOOP_MS = 65535;
const WHOLE_TURN = 360;

export class RunOptions {
  element = h("div", { class: "parts" });
  #camera = h("select", {}, ...CAMERAS.map(([text, flag]) => h("option", { value: String(flag) }, text)));
  #open = number(90, 0, WHOLE_TURN);
  #close = number(180, 0, WHOLE_TURN);
  #angles = h("div", { class: "row", hidden: true }, field("Shutter opens at, degrees", this.#open), field("Shutter closes at, degrees", this.#close));
  #output = h("select");
  #channel = number(0, 0, 512);
  #time = number(100, 1, LONGEST_BLOOP_MS);

  constructor() {
    this.#camera.addEventListener("change", () => {
      this.#angles.hidden = Number(this.#camera.value) !== M.RUN_STILLS;
    });
    this.element.append(
      h("h3", {}, "Camera"), field("Camera", this.#camera), this.#angles,
      h("h3", {}, "Bloop: light or sound at the first frame"), h("div", { class: "row" },
        field("Bloop output", this.#output), field("Bloop DMX channel", this.#channel, "0: none"), field("Bloop, ms", this.#time)));
    this.connected({ outputs: 0, dmx_channels: 0 });
  }

  /** Adapt to the device, by the fields of DeviceInfo. */
  connected({ outputs, dmx_channels: channels }) {
    const before = this.#output.value;
    this.#output.replaceChildren(h("option", { value: "0" }, "none"), ...Array.from({ length: outputs }, (_, i) => h("option", { value: String(2 ** i) }, `output ${i + 1}`)));
    if ([...this.#output.options].some((option) => option.value === before)) this.#output.value = before;
    this.#channel.max = String(channels);
  }

  /** Return the fields of RUN_MOVE for these options, with other `flags` of the run, or null for a wrong field. */
  values(flags) {
    const shown = this.#angles.hidden ? [] : [this.#open, this.#close];
    const numbers = [this.#channel, this.#time, ...shown].map(read);
    if (numbers.includes(null)) return null;
    const [channel, time, open = 0, close = 0] = numbers;
    const outputs = Number(this.#output.value);
    return {
      bloop_outputs: outputs,
      bloop_channel: channel,
      bloop_ms: outputs || channel ? time : 0,
      flags: flags | Number(this.#camera.value),
      open_angle: open,
      close_angle: close,
    };
  }
}
