// Inputs, outputs and lights.

import { check, field, h, number, read, setText } from "./dom.js";
import { M } from "./protocol.js";

const SHOWN = 12; // number of lights in the view
const HIGHEST_LEVEL = 255;
const CAMERA = [[M.GIO_CAM_SHUTTER, "Shutter"], [M.GIO_CAM_METER, "Meter"]];

export class OutputsView {
  title = "Inputs, outputs, lights";
  element = h("div", { class: "parts" });
  #device;
  #inputs = h("div", { class: "row" });
  #outputs = h("div", { class: "row" });
  #camera = h("div", { class: "row" });
  #lights = new Lights();

  constructor(device) {
    this.#device = device;
    this.#lights.send = (values) => device.demand("Dmx", values);
    this.#lights.failed = (error) => device.tell(error.message, true);
    const card = (title, ...parts) => h("article", { class: "card", "aria-label": title }, h("h3", {}, title), ...parts);
    this.element.append(
      h("div", { class: "cards" },
        card("Inputs", this.#inputs),
        card("Outputs", this.#outputs, h("p", { class: "faint" }, "The device does not report its outputs: a switch shows what this page has set. Each change sets all of them.")),
        card("Camera", this.#camera)),
      this.#lights.element,
    );
  }

  connected() {
    const { info } = this.#device.state;
    this.#inputs.replaceChildren(...lamps(info.inputs), ...(info.inputs ? [] : ["This device has no inputs."]));
    this.#outputs.replaceChildren(...this.#switches(range(info.outputs).map((i) => [2 ** i, `Output ${i + 1}`]), (bits) => ["GioOut", { outputs: bits }]), ...(info.outputs ? [] : ["This device has no outputs."]));
    this.#camera.replaceChildren(...(this.#device.can(M.CAP_CAMERA) ? this.#switches(CAMERA, (bits) => ["GioCam", { flags: bits }]) : ["This device has no camera outputs."]));
    this.#lights.show(info.dmx_channels);
  }

  render() {
    [...this.#inputs.querySelectorAll("output")].forEach((shown, i) => {
      const on = ((this.#device.state.inputs >>> i) & 1) === 1;
      shown.firstChild.classList.toggle("on", on);
      setText(shown.lastChild, on ? "on" : "off");
    });
  }

  /** Make a switch for each [bit, name]. Each one sends the bits of all. */
  #switches(parts, request) {
    const boxes = parts.map(([bit]) => h("input", { value: String(bit), role: "switch" }));
    for (const box of boxes) {
      box.addEventListener("change", async () => {
        const bits = boxes.filter((each) => each.checked).reduce((all, each) => all + Number(each.value), 0);
        if (!(await this.#device.ask(...request(bits)))) box.checked = !box.checked;
      });
    }
    return boxes.map((box, i) => check(parts[i][1], box));
  }
}

function range(count) {
  return Array.from({ length: count }, (_, i) => i);
}

function lamps(count) {
  return range(count).map((i) => h("div", {}, `Input ${i + 1} `, h("output", {}, h("span", { class: "lamp", "aria-hidden": "true" }), h("span", {}, "off"))));
}

/** Sliders for some neighbouring channels. A changed level is sent after the answer to the previous one. */
class Lights {
  element = h("article", { class: "card", "aria-label": "Lights" });
  /** Send a request DMX. */
  send = async () => {};
  failed = () => {};
  #levels = new Map(); // channel -> level that this page has set
  #channels = 0;
  #first = number(1, 1, 512);
  #fade = h("input");
  #sliders = h("div", { class: "lights" });
  #due = new Set();
  #sending = false;

  show(channels) {
    this.#channels = channels;
    this.#levels.clear();
    if (!channels) {
      this.element.replaceChildren(h("h3", {}, "Lights"), "This device has no lights.");
      return;
    }
    this.#first.max = String(channels);
    this.#first.addEventListener("change", () => this.#fill());
    this.element.replaceChildren(h("h3", {}, "Lights"),
      h("div", { class: "row" }, field("From channel", this.#first), check("Fade to each level", this.#fade),
        h("button", { type: "button", onclick: () => this.#dark() }, "All shown to 0")),
      this.#sliders);
    this.#fill();
  }

  #fill() {
    const first = read(this.#first);
    if (first === null) return;
    this.#sliders.replaceChildren(...range(Math.min(SHOWN, this.#channels - first + 1)).map((i) => this.#slider(first + i)));
  }

  #slider(channel) {
    const level = this.#levels.get(channel) ?? 0;
    const shown = h("output", {}, String(level));
    const slider = h("input", { type: "range", min: "0", max: String(HIGHEST_LEVEL), value: String(level) });
    slider.addEventListener("input", () => {
      setText(shown, slider.value);
      this.#set(channel, Number(slider.value));
    });
    return h("div", {}, field(`Channel ${channel}`, slider), shown);
  }

  #dark() {
    const first = Number(this.#first.value);
    for (const i of range(this.#sliders.children.length)) this.#set(first + i, 0);
    this.#fill();
  }

  #set(channel, level) {
    this.#levels.set(channel, level);
    this.#due.add(channel);
    this.#sendDue();
  }

  async #sendDue() {
    if (this.#sending) return;
    this.#sending = true;
    try {
      while (this.#due.size) {
        const channel = this.#due.values().next().value;
        this.#due.delete(channel);
        await this.send({ ramp: Number(this.#fade.checked), channel, levels: [this.#levels.get(channel)] });
      }
    } catch (error) {
      this.#due.clear();
      this.failed(error);
    } finally {
      this.#sending = false;
    }
  }
}
