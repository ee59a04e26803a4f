// Keyframes: make a move here. Drive the rig to a pose, keep it as a keyframe, and bend the curves between them.

import { download, field, h, number, positionField, read, readSteps, setText } from "../dom.js";
import { KeyframeCurve } from "../keyframe_curve.js";
import { Keyframes, WAYS } from "../keyframes.js";
import { moveText } from "../move_csv.js";
import { MoveNeeds } from "../move_needs.js";
import { FORMATS, M } from "../protocol.js";

const FARTHEST_FRAME = 1_000_000;
const SAVED = "keyframes"; // in the browser
const NEXT = 24; // frames from the last keyframe to the one that is suggested
const MOST_UNDONE = 50;
const LONGEST_TEXT = 900_000; // characters of a move that the server takes
const STEPS_FORMAT = "steps"; // CSV in steps, which needs no server
const GREATEST = 1e9; // steps per frame

export class KeyframesView {
  title = "Keyframes";
  worksAlone = true;
  element = h("section");
  #device;
  #use;
  #keyframes = new Keyframes();
  #before = []; // texts, for Undo
  #move = null;
  #curve;
  #needs;
  #frame = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);
  #keep = h("button", { class: "main" }, "Keyframe here");
  #fps = number(24, 0.001, 1000, { step: "0.001", inputMode: "decimal" });
  #undo = h("button", { type: "button", disabled: true, onclick: () => this.#takeBack() }, "Undo");
  #motor = h("select");
  #table = h("div", { class: "wide poses" });
  #why = h("p", { class: "faint" });
  #verdict = h("pre", { role: "status", "aria-label": "Verdict" });
  #check = h("button", { type: "button", onclick: () => this.#judge() }, "Check as the board would");
  #apply = h("button", { type: "button", class: "main", onclick: () => this.#hand() }, "Use it in Moves");
  #file = h("input", { type: "file", accept: ".json,application/json", onchange: () => this.#open() });
  #format = h("select", {}, h("option", { value: STEPS_FORMAT }, "CSV in steps, for framestep upload"), ...Object.entries(FORMATS).map(([name, ending]) => h("option", { value: name }, `${name} (${ending})`)));

  /** use(move, name, fps): takes a finished move. */
  constructor(device, use) {
    this.#device = device;
    this.#use = use;
    this.#curve = new KeyframeCurve(device.axes, this.#keyframes, (what) => this.#dragged(what));
    this.#needs = new MoveNeeds(device);
    this.#fps.addEventListener("change", () => this.#changed());
    this.#motor.addEventListener("change", () => this.#show());
    device.axes.addEventListener("change", () => this.#show());
    this.element.append(
      h("article", { class: "card", "aria-label": "Keyframe" },
        h("p", { class: "faint" }, "Drive the rig to a pose, under Motors or Virtual axes, and keep it as a keyframe. Between keyframes each motor follows its curve."),
        h("form", { onsubmit: (event) => this.#put(event) }, field("Frame", this.#frame), this.#keep, field("Frames per second", this.#fps), this.#undo)),
      h("article", { class: "card", "aria-label": "Poses" }, field("Handles and slope of", this.#motor, "drag its marks in the drawing, or type into the table"), this.#table),
      this.#curve.element,
      h("article", { class: "card", "aria-label": "Preview" }, h("h2", {}, "Preview"), this.#why, this.#needs.element,
        h("div", { class: "row" }, this.#check, this.#apply), this.#verdict),
      h("article", { class: "card", "aria-label": "Files" }, h("h2", {}, "Files"),
        h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#save() }, "Save the keyframes"), field("Open keyframes", this.#file)),
        h("div", { class: "row" }, field("Export the move as", this.#format), h("button", { type: "button", onclick: () => this.#export() }, "Export"))),
    );
    const saved = localStorage.getItem(SAVED);
    if (saved) this.#read(saved, "the browser");
    this.#show();
  }

  connected() {
    this.#check.hidden = !this.#device.client.keeps;
    this.#show();
  }

  shown() {
    this.#showNeeds(); // speeds may have been set elsewhere
  }

  render() {
    const { state } = this.#device;
    this.#keep.disabled = !this.#device.knowsWhatMoves || state.moving !== 0;
    for (const button of this.#table.querySelectorAll("button.go")) button.disabled = this.#keep.disabled;
    if (this.#move && this.#device.connected) this.#curve.at(state.playHead / 1000, state.positions);
  }

  // ---- changes

  /** Keep the present state for Undo; call it before a change. */
  #remember() {
    this.#before.push(this.#keyframes.text(this.#rate()));
    if (this.#before.length > MOST_UNDONE) this.#before.shift();
  }

  #takeBack() {
    this.#read(this.#before.pop(), "Undo");
    this.#changed();
  }

  #rate() {
    return this.#fps.checkValidity() ? Number(this.#fps.value) : 24;
  }

  #put(event) {
    event.preventDefault();
    const frame = read(this.#frame);
    if (frame === null) return;
    const { positions } = this.#device.state;
    if (this.#keyframes.motors && this.#keyframes.motors !== positions.length) {
      this.#device.tell(`These keyframes are for ${this.#keyframes.motors} motors, and the device has ${positions.length}.`, true);
      return;
    }
    this.#remember();
    this.#keyframes.put(frame, positions);
    this.#frame.value = String(Math.min(this.#keyframes.all.at(-1).frame + NEXT, FARTHEST_FRAME));
    this.#device.tell(`Frame ${frame} is a keyframe.`);
    this.#changed();
  }

  #dragged(what) {
    if (what === "begin") this.#remember();
    else if (what === "drag") this.#draw();
    else this.#changed();
  }

  /** Keep changed keyframes in the browser, and show them. */
  #changed() {
    localStorage.setItem(SAVED, this.#keyframes.text(this.#rate()));
    setText(this.#verdict, "");
    this.#show();
  }

  // ---- what is shown

  #show() {
    const { axes } = this.#device;
    const { motors } = this.#keyframes;
    const chosen = this.#motor.value;
    this.#motor.replaceChildren(...Array.from({ length: motors }, (_, motor) => h("option", { value: String(motor) }, axes.of(motor + 1).title)));
    if (Number(chosen) < motors && chosen !== "") this.#motor.value = chosen;
    this.#undo.disabled = this.#before.length === 0;
    this.#fill();
    this.#draw();
    this.#showNeeds();
    this.#device.dispatchEvent(new Event("change"));
  }

  #draw() {
    this.#move = null;
    let why = "";
    try {
      this.#move = this.#keyframes.toMove(this.#names());
    } catch (error) {
      why = `No move yet: ${error.message}.`;
    }
    setText(this.#why, why);
    this.#check.disabled = this.#apply.disabled = this.#move === null;
    this.#curve.show(this.#move, Number(this.#motor.value));
  }

  #names() {
    return Array.from({ length: this.#keyframes.motors }, (_, i) => this.#device.axes.of(i + 1).name);
  }

  async #showNeeds() {
    this.#needs.element.hidden = this.#move === null;
    if (this.#move) await this.#needs.show(this.#move, this.#rate());
  }

  #fill() {
    const { all } = this.#keyframes;
    const axes = this.#names().map((_, i) => this.#device.axes.of(i + 1));
    const chosen = Number(this.#motor.value);
    if (!all.length) {
      this.#table.replaceChildren(h("p", { class: "faint" }, "There are no keyframes yet."));
      return;
    }
    const head = (text) => h("th", { scope: "col" }, text);
    this.#table.replaceChildren(h("table", {},
      h("thead", {}, h("tr", {}, head("Frame"), head("To the next"), ...axes.map((axis) => head(axis.title)), head(`Slope of ${axes[chosen].name}`), head("Pose"))),
      h("tbody", {}, ...all.map((key, at) => this.#row(key, at, axes, chosen)))));
  }

  #row(key, at, axes, chosen) {
    const label = (what) => ({ "aria-label": `${what}, frame ${key.frame}` });
    const frame = number(key.frame, -FARTHEST_FRAME, FARTHEST_FRAME, label("Frame"));
    frame.addEventListener("change", () => {
      const wanted = read(frame);
      if (wanted === null) return;
      if (wanted !== key.frame && this.#keyframes.at(wanted)) {
        this.#device.tell(`Frame ${wanted} has a keyframe already.`, true);
        frame.value = String(key.frame);
        return;
      }
      this.#change(() => this.#keyframes.shift(key, wanted));
    });
    const way = h("select", label("To the next"), ...Object.entries(WAYS).map(([value, text]) => h("option", { value }, text)));
    way.value = key.way;
    way.addEventListener("change", () => this.#change(() => { key.way = way.value; }));
    const places = axes.map((axis, motor) => {
      const input = positionField(axis, key.steps[motor], label(axis.title));
      input.addEventListener("change", () => {
        const steps = readSteps(axis, input);
        if (steps !== null) this.#change(() => { key.steps[motor] = steps; });
      });
      return input;
    });
    return h("tr", {}, ...[
      frame,
      at + 1 < this.#keyframes.all.length ? way : "",
      ...places,
      this.#slopeField(key, at, axes[chosen], chosen, label(`Slope of ${axes[chosen].name}`)),
      h("div", { class: "pair" },
        h("button", { type: "button", class: "go", ...label("Go to the pose"), onclick: () => this.#go(key) }, "Go"),
        h("button", { type: "button", ...label("Remove the keyframe"), onclick: () => this.#change(() => this.#keyframes.remove(key)) }, "Remove")),
    ].map((content) => h("td", {}, content)));
  }

  /** A field for units per frame; if it is empty, the automatic slope is shown in grey. */
  #slopeField(key, at, axis, motor, label) {
    const unit = axis.perUnit; // may be negative
    const shown = (slope) => String(Number((slope / unit).toFixed(axis.decimals + 3)));
    const input = number("", -GREATEST, GREATEST, { step: "any", inputMode: "decimal", required: false, placeholder: shown(this.#keyframes.slope(at, motor)), ...label });
    if (key.slopes[motor] !== null) input.value = shown(key.slopes[motor]);
    input.addEventListener("change", () => {
      if (input.reportValidity()) this.#change(() => { key.slopes[motor] = input.value === "" ? null : Number(input.value) * unit; });
    });
    return input;
  }

  #change(doIt) {
    this.#remember();
    doIt();
    this.#changed();
  }

  /** Send all motors to a pose. */
  async #go(key) {
    const beyond = key.steps.map((steps, motor) => this.#device.axes.of(motor + 1).beyond(steps)).find(Boolean);
    if (beyond) {
      this.#device.tell(beyond, true);
      return;
    }
    for (const [motor, position] of key.steps.entries()) {
      if (!(await this.#device.ask("MotorMove", { motor: motor + 1, position }))) return;
    }
  }

  // ---- the move

  #asJson(more) {
    return JSON.stringify({ start: this.#move.startFrame, positions: this.#move.positions, fps: this.#rate(), ...more });
  }

  async #judge() {
    const device = this.#device;
    try {
      const { motors, upload_frames: frames } = device.state.info;
      const set = [];
      for (let motor = 1; motor <= this.#keyframes.motors; motor += 1) {
        const told = await device.settingsOf(motor);
        if (!told) throw new Error(`${device.axes.of(motor).title}: the device does not report its settings`);
        const limit = (end, bit) => (told.bits & bit ? end : null);
        set.push({ velocity: told.velocity, acceleration: told.acceleration, lower: limit(told.lower, M.SET_LOWER), upper: limit(told.upper, M.SET_UPPER) });
      }
      const { lines } = await this.#ask("check_move", this.#asJson({ motors, frames, set }));
      setText(this.#verdict, lines.join("\n"));
    } catch (error) {
      device.tell(error.message, true);
    }
  }

  async #ask(task, text) {
    if (text.length > LONGEST_TEXT) throw new Error("the move is too long for this: export it in steps, and use the command line");
    return this.#device.client.ask(task, { text });
  }

  #hand() {
    this.#use(this.#move, "keyframes", this.#rate());
  }

  // ---- files

  /** Take a text's keyframes. A mistake is shown, and changes nothing. */
  #read(text, from) {
    try {
      this.#fps.value = String(this.#keyframes.read(text));
      return true;
    } catch (error) {
      this.#device.tell(`${from}: ${error.message}`, true);
      return false;
    }
  }

  async #open() {
    const [file] = this.#file.files;
    if (!file) return;
    this.#remember();
    if (this.#read(await file.text(), file.name)) this.#changed();
    else this.#before.pop();
    this.#file.value = ""; // so that the same file can be opened again
  }

  #save() {
    download("keyframes.json", this.#keyframes.text(this.#rate()), "application/json");
  }

  async #export() {
    if (!this.#move) {
      this.#device.tell(this.#why.textContent, true);
      return;
    }
    const format = this.#format.value;
    if (format === STEPS_FORMAT) {
      download("move.csv", moveText(this.#move), "text/csv");
      return;
    }
    try {
      if (!this.#device.client?.keeps) throw new Error("This takes framestep console: export in steps, and use framestep export.");
      const { text } = await this.#ask("export_move", this.#asJson({ format }));
      download(`move${FORMATS[format]}`, text);
    } catch (error) {
      this.#device.tell(error.message, true);
    }
  }
}
