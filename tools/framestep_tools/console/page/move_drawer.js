// The drawer of the move: files, what it needs next to what is set, the keyframes as a table.

import { check, download, field, h, number, positionField, read, readSteps, setText, wide } from "./dom.js";
import { WAYS } from "./keyframes.js";
import { moveText, textOf } from "./move_csv.js";
import { FORMATS, M } from "./protocol.js";

const FARTHEST_FRAME = 1_000_000;
const LONGEST_TEXT = 900_000; // characters of a move that the server takes
const STEPS_FORMAT = "steps"; // CSV in steps, which needs no server
const GREATEST = 1e9; // steps per frame
const NEXT = 24; // frames from the last keyframe to the one that is suggested
const OTHERS = /"(?:asset|transformsBaked|positionKeyframes|keyframesFormat)"/; // in JSON of other programs
const ACCEPTED = ".json,.csv,.tsv,.txt,.arcm,.anim,.chan,.bvh,.kup,.asc,.mov,.raw,.xml,.fla,.cart,.aetxt,.gltf,.glb,.usd,.usda,.usdc,application/json,text/csv";

export class MoveDrawer {
  element = h("div", { class: "parts" });
  #device;
  #work;
  #desk;
  #about = h("p", { class: "faint" });
  #file = h("input", { type: "file", accept: ACCEPTED, onchange: () => this.#open() });
  #format = h("select", {}, h("option", { value: STEPS_FORMAT }, "CSV in steps, for framestep upload"), ...Object.entries(FORMATS).map(([name, ending]) => h("option", { value: name }, `${name} (${ending})`)));
  #pose = h("input", {});
  #needs = wide("Needs of the motors");
  #raise = h("button", { type: "button", onclick: () => this.#work.raise() }, "Raise the speeds to fit");
  #judged = h("pre", { role: "status", "aria-label": "Verdict" });
  #judge = h("button", { type: "button", onclick: () => this.#check() }, "Check as the board would");
  #frame = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);
  #keep = h("button", { class: "main" }, "Keyframe here");
  #table = wide("Table of the poses");
  #useKeys = h("button", { type: "button", onclick: () => this.#work.useKeys() }, "Keyframes");
  #begin = h("button", { type: "button", onclick: () => this.#work.begin() }, "New move");

  /** desk: {device, work, usable}. */
  constructor(desk) {
    this.#desk = desk;
    this.#device = desk.device;
    this.#work = desk.work;
    this.element.append(
      h("article", { class: "parts", "aria-label": "Files" },
        field("Open a move", this.#file, "keyframes (JSON), CSV as for framestep upload, or another program's file"),
        h("div", { class: "row" }, this.#work.recent.element, this.#useKeys, this.#begin),
        this.#about,
        h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#save() }, "Save the keyframes"),
          field("Export the move as", this.#format), check("The camera's pose, not the axes", this.#pose), h("button", { type: "button", onclick: () => this.#export() }, "Export"))),
      h("article", { class: "parts", "aria-label": "Needs" }, h("h3", {}, "What it needs, and what is set"), this.#needs,
        h("div", { class: "row" }, this.#raise, this.#judge), this.#judged),
      h("article", { class: "parts", "aria-label": "Keyframe" }, h("h3", {}, "Keyframes"),
        h("form", { onsubmit: (event) => this.#put(event) }, field("Frame", this.#frame), this.#keep)),
      h("article", { class: "poses", "aria-label": "Poses" }, this.#table));
    for (const name of ["change", "chosen"]) this.#work.addEventListener(name, () => this.show());
    this.show();
  }

  connected() {
    this.#judge.hidden = !this.#device.client.keeps;
  }

  render() {
    this.#keep.disabled = !this.#device.knowsWhatMoves || this.#device.state.moving !== 0 || !this.#work.editable;
    this.#raise.disabled = !this.#desk.usable || this.#device.state.moving !== 0;
    for (const button of this.#table.querySelectorAll("button.go")) button.disabled = this.#keep.disabled;
  }

  /** Show another move; while the drawer is closed, nothing is made. */
  show() {
    setText(this.#judged, "");
    setText(this.#about, this.#work.move ? `${this.#work.name}: ${this.#work.about}` : this.#work.why);
    this.#useKeys.hidden = this.#work.editable;
    this.#judge.disabled = this.#work.move === null;
    if (this.element.closest("[hidden]")) return;
    this.#showNeeds();
    this.#fill();
    this.render();
  }

  #showNeeds() {
    const { checked, fps } = this.#work;
    const cell = (axis, need, set, per) => h("td", { class: set !== undefined && need > set ? "bad" : "" },
      axis.fullRate(need, per), set === undefined ? "" : `, set ${axis.fullRate(set, per)}${need > set ? ": too little" : ""}`);
    const range = (axis, { lowest, highest }, misfits) => {
      const past = misfits.find(({ what }) => what === "limit");
      const ends = [lowest, highest].map((steps) => axis.brief(steps));
      return h("td", { class: past ? "bad" : "" }, `${(axis.perUnit < 0 ? ends.reverse() : ends).join(" to ")}${past ? `: ${past.text} at frame ${past.at}` : ""}`);
    };
    this.#raise.hidden = !checked.some(({ misfits }) => misfits.some(({ what }) => what !== "limit")) && !this.#work.refused;
    this.#needs.replaceChildren(checked.length ? h("table", {},
      h("caption", { class: "faint" }, `At ${fps} frames/s`),
      h("thead", {}, h("tr", {}, ...["Motor", "Velocity", "Acceleration", "Positions"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, ...checked.map(({ axis, need, set, misfits }) => h("tr", {}, h("th", { scope: "row" }, axis.title),
        cell(axis, need.velocity, set?.velocity, "s"), cell(axis, need.acceleration, set?.acceleration, "s²"), range(axis, need, misfits))))) : "");
  }

  // ---- the keyframes

  #put(event) {
    event.preventDefault();
    const frame = read(this.#frame);
    if (frame === null) return;
    this.#work.put(frame);
    this.#frame.value = String(Math.min((this.#work.keys.all.at(-1)?.frame ?? frame) + NEXT, FARTHEST_FRAME));
  }

  #fill() {
    const { keys, editable, chosen } = this.#work;
    const { all, motors } = keys;
    const axes = Array.from({ length: motors }, (_, i) => this.#device.axes.of(i + 1));
    if (!editable || !all.length) {
      this.#table.replaceChildren(h("p", { class: "faint" }, editable ? "There are no keyframes yet." : "A file has none."));
      return;
    }
    const motor = Math.min(chosen, motors) - 1;
    const head = (text) => h("th", { scope: "col" }, text);
    this.#table.replaceChildren(h("table", {},
      h("thead", {}, h("tr", {}, head("Frame"), head("To the next"), ...axes.map((axis) => head(axis.title)), head(`Slope of ${axes[motor].name}`), head("Pose"))),
      h("tbody", {}, ...all.map((key, at) => this.#row(key, at, axes, motor)))));
  }

  #row(key, at, axes, chosen) {
    const label = (what) => ({ "aria-label": `${what}, frame ${key.frame}` });
    const { keys } = this.#work;
    const frame = number(key.frame, -FARTHEST_FRAME, FARTHEST_FRAME, label("Frame"));
    frame.addEventListener("change", () => {
      const wanted = read(frame);
      if (wanted === null) return;
      if (wanted !== key.frame && keys.at(wanted)) {
        this.#device.tell(`Frame ${wanted} has a keyframe already.`, true);
        frame.value = String(key.frame);
        return;
      }
      this.#work.change(() => keys.shift(key, wanted));
    });
    const way = h("select", label("To the next"), ...Object.entries(WAYS).map(([value, text]) => h("option", { value }, text)));
    way.value = key.way;
    way.addEventListener("change", () => this.#work.change(() => { key.way = way.value; }));
    const places = axes.map((axis, motor) => {
      const input = positionField(axis, key.steps[motor], label(axis.title));
      input.addEventListener("change", () => {
        const steps = readSteps(axis, input);
        if (steps !== null) this.#work.change(() => { key.steps[motor] = steps; });
      });
      return input;
    });
    return h("tr", {}, ...[
      frame,
      at + 1 < keys.all.length ? way : "",
      ...places,
      this.#slopeField(key, at, axes[chosen], chosen, label(`Slope of ${axes[chosen].name}`)),
      h("div", { class: "pair" },
        h("button", { type: "button", class: "go", ...label("Go to the pose"), onclick: () => this.#go(key) }, "Go"),
        h("button", { type: "button", ...label("Remove the keyframe"), onclick: () => this.#work.change(() => keys.remove(key)) }, "Remove")),
    ].map((content) => h("td", {}, content)));
  }

  /** A field for units per frame; if it is empty, the automatic slope is shown in grey. */
  #slopeField(key, at, axis, motor, label) {
    const unit = axis.perUnit; // may be negative
    const shown = (slope) => String(Number((slope / unit).toFixed(axis.decimals + 3)));
    const input = number("", -GREATEST, GREATEST, { step: "any", inputMode: "decimal", required: false, placeholder: shown(this.#work.keys.slope(at, motor)), ...label });
    if (key.slopes[motor] !== null) input.value = shown(key.slopes[motor]);
    input.addEventListener("change", () => {
      if (input.reportValidity()) this.#work.change(() => { key.slopes[motor] = input.value === "" ? null : Number(input.value) * unit; });
    });
    return input;
  }

  /** Send all motors to a pose. */
  async #go(key) {
    const beyond = key.steps.map((steps, motor) => this.#device.axes.of(motor + 1).beyond(steps)).find(Boolean);
    if (beyond) {
      this.#device.tell(beyond, true);
      return;
    }
    this.#work.look(key.frame);
    for (const [motor, position] of key.steps.entries()) {
      if (!(await this.#device.ask("MotorMove", { motor: motor + 1, position }))) return;
    }
  }

  // ---- the board's verdict

  /** Return the move as the server's tasks take it: a column for each motor up to the last. */
  #asJson(more) {
    const { move, fps } = this.#work;
    const last = Math.max(...move.motors);
    const still = move.positions[0].map(() => 0);
    const positions = Array.from({ length: last }, (_, i) => move.positions[move.motors.indexOf(i + 1)] ?? still);
    return JSON.stringify({ start: move.startFrame, positions, fps, ...more });
  }

  async #check() {
    const device = this.#device;
    try {
      const { motors, upload_frames: frames } = device.state.info;
      const set = [];
      for (let motor = 1; motor <= Math.max(...this.#work.move.motors); motor += 1) {
        const told = await device.settingsOf(motor);
        if (!told) throw new Error(`${device.axes.of(motor).title}: the device does not report its settings`);
        const limit = (end, bit) => (told.bits & bit ? end : null);
        set.push({ velocity: told.velocity, acceleration: told.acceleration, lower: limit(told.lower, M.SET_LOWER), upper: limit(told.upper, M.SET_UPPER) });
      }
      const { lines } = await this.#ask("check_move", this.#asJson({ motors, frames, set }));
      setText(this.#judged, lines.join("\n"));
    } catch (error) {
      device.tell(error.message, true);
    }
  }

  async #ask(task, text) {
    if (text.length > LONGEST_TEXT) throw new Error("the move is too long for this: export it in steps, and use the command line");
    return this.#device.client.ask(task, { text });
  }

  // ---- files

  async #open() {
    const [file] = this.#file.files;
    if (!file) return;
    try {
      const bytes = new Uint8Array(await file.arrayBuffer());
      const text = await textOf(file).catch((error) => {
        if (!this.#device.client?.keeps) throw error;
        return null; // framestep console reads other encodings, and scenes in binary
      });
      const json = /\.json$/i.test(file.name) || text?.trimStart()[0] === "{";
      if (text !== null && json && !OTHERS.test(text)) this.#work.openKeys(text, file.name);
      else await this.#work.takeText(text, file.name, bytes);
    } catch (error) {
      this.#device.tell(error.message, true);
    }
    this.#file.value = ""; // so that the same file can be opened again
  }

  #save() {
    download("keyframes.json", this.#work.keys.text(this.#work.fps), "application/json");
  }

  async #export() {
    const { move, why } = this.#work;
    if (!move) {
      this.#device.tell(why, true);
      return;
    }
    const format = this.#format.value;
    if (format === STEPS_FORMAT) {
      download("move.csv", moveText(move), "text/csv");
      return;
    }
    try {
      if (!this.#device.client?.keeps) throw new Error("This takes framestep console: export in steps, and use framestep export.");
      const { text } = await this.#ask("export_move", this.#asJson({ format, pose: this.#pose.checked }));
      download(`move${FORMATS[format]}`, text);
    } catch (error) {
      this.#device.tell(error.message, true);
    }
  }
}
