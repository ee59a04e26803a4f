// Virtual axes: the rig's configuration, the camera's pose, jogs along straight lines. Two drawers share them.

import { check, field, h, number, read, setText } from "./dom.js";
import { TYPES } from "./kinematics.js";
import { M } from "./protocol.js";
import { Recent } from "./recent.js";
import { packConfig, parseTable } from "./virtual_config.js";

const POSITION = 100_000;
const MILLI = 1000;
const FULL_SPEED = 10_000;
const FARTHEST = 2_000_000_000; // a step of the main motor beyond every jog
const LENGTHS = { length: 1000 }; // an arm of length 0 is refused
// Virtual motors, their fields of VirtPositions, and the axes of their main motors
const POSE = [
  [M.VIRT_MOTOR_TRACK, "vTrack", "track", ["track", "z"]],
  [M.VIRT_MOTOR_EW, "vEW", "east_west", ["swing", "x"]],
  [M.VIRT_MOTOR_NS, "vNS", "north_south", ["boom", "y"]],
  [M.VIRT_MOTOR_PAN, "vPan", "pan", ["pan"]],
  [M.VIRT_MOTOR_TILT, "vTilt", "tilt", ["tilt"]],
  [M.VIRT_MOTOR_ROLL, "vRoll", "roll", ["roll"]],
];
const LINES = [
  [M.LINE_X, "right", "left", M.VIRT_MOTOR_EW],
  [M.LINE_Y, "up", "down", M.VIRT_MOTOR_NS],
  [M.LINE_Z, "backward", "forward", M.VIRT_MOTOR_TRACK],
];

const ARROWS = { up: "▲", down: "▼", left: "◀", right: "▶", forward: "⤒", backward: "⤓" };

export class Virtual {
  /** The drawer of the camera, and the part of Set up. */
  camera = h("div", { class: "parts" });
  setup = h("div", { class: "parts" });
  /** The rig as this page has configured it, or null. */
  rig = null;
  #device;
  #holds;
  #renewed;
  #recent = new Recent("recent rigs", "Configured before", (saved) => this.#takeUp(saved));
  #type = h("select", {}, ...Object.entries(TYPES).map(([type, { name }]) => h("option", { value: type }, name)));
  #fields = h("div");
  #axes = [];
  #lengths = {};
  #table = h("textarea", { rows: 4, spellcheck: false });
  #speed = h("input", { type: "range", min: "1", max: "100", value: "20" });
  #pose = h("div", { class: "parts" });
  #poses = [];
  #without = [h("p", { class: "faint" }), h("p", { class: "faint" })];
  #able = [];

  /** renewed(): called when the rig has changed; toSetup(): shows the configuration. */
  constructor(device, holds, renewed, toSetup) {
    this.#device = device;
    this.#holds = holds;
    this.#renewed = renewed;
    device.axes.addEventListener("change", () => this.#rename());
    this.#type.addEventListener("change", () => this.#fill({}));
    this.#able = [
      h("form", { "aria-label": "The rig", onsubmit: (event) => this.#configure(event) },
        field("Type", this.#type), this.#fields,
        h("div", { class: "row" }, this.#recent.element, h("button", { class: "main" }, "Configure"),
          h("button", { type: "button", onclick: () => this.#forget() }, "No virtual axes"))),
      h("div", { class: "parts" }, h("h3", {}, "Along the camera's own axes"), this.#cross(), field("Jog speed, % of what the motors allow", this.#speed),
        h("h3", {}, "Each virtual axis"), this.#pose, this.#aimCard(),
        h("button", { type: "button", onclick: toSetup }, "The rig's kind, motors and lengths…")),
    ];
    this.setup.append(this.#without[0], this.#able[0]);
    this.camera.append(this.#without[1], this.#able[1]);
  }

  connected() {
    const can = this.#device.can(M.CAP_VIRTUALS);
    for (const text of this.#without) setText(text, can ? "" : "This device has no virtual axes.");
    for (const part of this.#able) part.hidden = !can;
    this.rig = null;
    this.#takeUp(this.#recent.newest ?? {});
    this.#showPose();
    this.#renewed();
  }

  render() {
    const { virtual } = this.#device.state;
    for (const { shown, name } of this.#poses) setText(shown, virtual ? (virtual[name] / POSITION).toFixed(3) : "–");
  }

  // ---- the rig's configuration

  /** Put a set-up into the fields. */
  #takeUp(saved) {
    if (TYPES[saved.type]) this.#type.value = saved.type;
    this.#fill(saved);
  }

  #fill(saved) {
    const { axes, arm } = TYPES[this.#type.value];
    const motors = () => h("select", {}, h("option", { value: "0" }, "none"), ...Array.from({ length: this.#device.motors }, (_, i) => h("option", { value: String(i + 1) }, this.#motorName(i + 1))));
    const real = (value) => number(value, -1_000_000, 1_000_000, { step: "any", inputMode: "decimal" });
    this.#axes = axes.map((name, i) => {
      const before = saved.axes?.[i] ?? {};
      const axis = { name, motor: motors(), perUnit: real(before.perUnit ?? 1000), position: real(before.position ?? 0) };
      const motor = before.motor ?? i + 1;
      axis.motor.value = String(motor > this.#device.motors ? 0 : motor);
      return axis;
    });
    const length = (name, label) => field(label, (this.#lengths[name] = real(saved[name] ?? LENGTHS[name] ?? 0)));
    this.#lengths = {};
    const swingPan = Number(this.#type.value) === M.VIRT_SWING_PAN;
    const lengths = swingPan ? [] : [
      ...(arm ? [length("length", "Arm"), length("extension", "Extension")] : []),
      length("nodalX", "Nodal point to the right"), length("nodalY", "Nodal point forward"), length("nodalZ", "Nodal point up"),
    ];
    this.#fields.replaceChildren(
      h("div", { class: "axes" }, ...this.#axes.map((axis) => h("fieldset", { class: "row" }, h("legend", {}, axis.name),
        field("Motor", axis.motor), field("Steps per unit or degree", axis.perUnit),
        swingPan ? null : field("Pose now", axis.position)))),
      h("div", { class: "row" }, ...lengths),
      ...(Number(this.#type.value) === M.VIRT_BOOM_SWING_TRACK ? [this.#tableField(saved.table)] : []));
  }

  #motorName(motor) {
    const { name, settings } = this.#device.axes.of(motor);
    return settings ? `${name} (motor ${motor})` : name;
  }

  #rename() {
    for (const { motor } of this.#axes) for (const option of motor.options) if (option.value !== "0") option.text = this.#motorName(Number(option.value));
  }

  #tableField(table) {
    this.#table.value = table?.join(" ") ?? "";
    return h("details", { open: Boolean(table) }, h("summary", {}, "Boom table"),
      h("div", {}, field("The boom motor's step for each degree from −60 to 60", this.#table, "121 whole numbers, as a column of a table has them; they replace the boom's steps per degree. Empty: none.")));
  }

  async #configure(event) {
    event.preventDefault();
    const axes = this.#axes.map(({ motor, perUnit, position }) => ({ motor: Number(motor.value), perUnit: read(perUnit), position: position.isConnected ? read(position) : 0 }));
    const length = (name) => (this.#lengths[name] ? read(this.#lengths[name]) : 0);
    const table = this.#readTable();
    if (table === undefined) return;
    const saved = { type: Number(this.#type.value), axes, ...Object.fromEntries(["length", "extension", "nodalX", "nodalY", "nodalZ"].map((name) => [name, length(name)])) };
    if (JSON.stringify(saved).includes("null")) return;
    if (table) saved.table = table;
    const rig = { ...saved, table, nodal: [saved.nodalX, saved.nodalY, saved.nodalZ], safe: null };
    const bytes = this.#packed(rig);
    if (!bytes || !(await this.#device.ask("VirtConfig", { bytes }))) return;
    this.rig = rig;
    this.#recent.add(TYPES[rig.type].name, saved);
    this.#renewed();
    this.#device.tell(`${TYPES[rig.type].name}: configured.`);
    this.render();
  }

  /** Return the boom table or null; undefined for a mistake, which is shown. */
  #readTable() {
    if (!this.#table.isConnected) return null;
    try {
      return parseTable(this.#table.value);
    } catch (error) {
      this.#device.tell(error.message, true);
      return undefined;
    }
  }

  /** Return the payload; null if a number does not fit, which is shown. */
  #packed(rig) {
    try {
      return packConfig(rig);
    } catch (error) {
      this.#device.tell(error.message, true);
      return null;
    }
  }

  async #forget() {
    if (!(await this.#device.ask("VirtConfig", { bytes: packConfig({ type: M.VIRT_NONE }) }))) return;
    this.rig = null;
    this.#renewed();
    this.render();
  }

  // ---- pose and jogs

  #showPose() {
    this.#poses = POSE.map(([motor, label, name, mains]) => {
      const shown = h("output", { "aria-label": label, "aria-live": "off" });
      const target = number(0, -20_000, 20_000, { step: "any", inputMode: "decimal" });
      const move = async (event) => {
        event.preventDefault();
        const value = read(target);
        if (value !== null) await this.#device.ask("VirtMove", { motor, position: Math.round(value * POSITION) });
      };
      const hold = (text, up) => this.#holds.button(
        h("button", { type: "button", class: "hold", "aria-label": `Jog ${label} ${up ? "up" : "down"}` }, text),
        `virtual ${motor}`, () => this.#jog(motor, mains, up), () => this.#stop(motor));
      const card = h("article", { class: "virtual", "aria-label": label }, h("b", {}, label), shown, hold("−", false), hold("+", true),
        h("form", { onsubmit: move }, target, h("button", {}, "Move")));
      target.setAttribute("aria-label", "Move to");
      return { name, shown, card };
    });
    this.#pose.replaceChildren(...this.#poses.map(({ card }) => card));
  }

  async #jog(motor, mains, up) {
    const axis = this.rig?.axes[TYPES[this.rig.type].axes.findIndex((name) => mains.includes(name))];
    const steps = up === ((axis?.perUnit ?? 1) > 0) ? FARTHEST : -FARTHEST;
    await this.#held("VirtJog", { motor, speed: this.#share(), destination: steps });
  }

  /** The camera's six directions as a cross, with forward and backward next to it. */
  #cross() {
    const hold = (axis, text, sign, motor) => this.#holds.button(
      h("button", { type: "button", class: `hold ${text}`, "aria-label": `Camera ${text}` }, h("span", { "aria-hidden": "true" }, ARROWS[text]), text), `line ${axis}`,
      async () => {
        await this.#held("VirtJogOnLine", { axis, speed: sign * this.#share() });
        return false; // it goes on until VIRT_STOP
      },
      () => this.#stop(motor));
    return h("div", { class: "cross" }, ...LINES.flatMap(([axis, plus, minus, motor]) => [hold(axis, minus, -1, motor), hold(axis, plus, 1, motor)]));
  }

  #share() {
    return Math.round((FULL_SPEED * Number(this.#speed.value)) / 100);
  }

  async #held(request, values) {
    try {
      await this.#device.demand(request, values);
    } catch (error) {
      this.#device.tell(error.message, true);
      throw error;
    }
  }

  #stop(motor) {
    if (this.#device.client) this.#device.ask("VirtStop", { motor });
  }

  #aimCard() {
    const inputs = ["X", "Y", "Z"].map((name) => [name, number(0, -1_000_000, 1_000_000, { step: "any", inputMode: "decimal" })]);
    const on = h("input");
    const send = async (event) => {
      event.preventDefault();
      const [x, y, z] = inputs.map(([, input]) => read(input));
      if ([x, y, z].includes(null)) return;
      const [a, b, c] = [x, y, z].map((value) => Math.round(value * MILLI));
      if (await this.#device.ask("SetVirtAimPoint", { enable: Number(on.checked), x: a, y: b, z: c })) this.#device.tell(`The aim point is ${on.checked ? "on" : "off"}.`);
    };
    return h("article", { "aria-label": "Aim point" }, h("h3", {}, "Aim point"),
      h("form", { onsubmit: send }, check("Pan and tilt stay on it", on), ...inputs.map(([name, input]) => field(name, input)), h("button", {}, "Set aim point")));
  }
}
