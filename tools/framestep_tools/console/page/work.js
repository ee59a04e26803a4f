// The move on the desk: keyframes that are made here, or a file. One move is shown, checked, uploaded and played.

import { Keyframes } from "./keyframes.js";
import { misfits, needs } from "./move_needs.js";
import { moveText, parseMove, positionAt } from "./move_csv.js";
import { read } from "./dom.js";
import { Recent } from "./recent.js";
import { upload } from "./upload.js";

const SAVED = "keyframes"; // in the browser
const SHOWN = "move"; // which of the two is on the desk, in the browser
const MOST_UNDONE = 50;
const LONGEST_TEXT = 900_000; // characters of a request that the server takes
const SPARE = 1.1; // a speed is raised to that times what the move needs
const MOST_RATE = 4294967295;

/** Return "1 motor" or "3 motors". */
export function motorCount({ motors }) {
  return motors.length === 1 ? "1 motor" : `${motors.length} motors`;
}

/** Events: "change" for another move or other needs, "see" for another frame of the preview, "chosen", "opened", "edited" by
 * the user. */
export class Work extends EventTarget {
  keys = new Keyframes();
  /** The move, as parseMove returns it, or null; `why` says why there is none. */
  move = null;
  why = "";
  name = "";
  about = "";
  /** Number of the motor whose curve is edited, and which keys jog. */
  chosen = 1;
  /** Frame of the preview. */
  see = 1;
  /** Share that is uploaded, while an upload goes on; else null. */
  uploading = null;
  /** What each motor of the move needs: [{motor, axis, need, set, misfits}]. */
  checked = [];
  /** What the board has refused last: {motor, velocity, acceleration}, in steps; null after any change. */
  refused = null;
  recent;
  #device;
  #fps;
  #file = null; // {move, name, about}
  #onBoard = null; // the move that is uploaded
  #before = []; // texts, for Undo
  #stops = 0; // number of STOPs: an upload ends with the next one

  /** fps: the field for frames per second. */
  constructor(device, fps) {
    super();
    this.#device = device;
    this.#fps = fps;
    fps.addEventListener("change", () => this.#changed());
    this.recent = new Recent("recent moves", "Used before", (text, name) => this.takeText(text, name));
    device.axes.addEventListener("change", () => this.#made());
    device.addEventListener("settings", () => this.check());
    device.addEventListener("connected", () => {
      this.#onBoard = null;
      this.refused = null;
      this.check();
    });
    const saved = localStorage.getItem(SAVED);
    if (saved) this.#takeKeys(saved, "the browser");
    const newest = localStorage.getItem(SHOWN) === "file" ? this.recent.newestEntry : null;
    if (newest) this.#tryParse(newest.content, newest.name);
    this.#made();
    this.see = this.move?.startFrame ?? 1;
  }

  get fps() {
    return this.#fps.checkValidity() ? Number(this.#fps.value) : 24;
  }

  /** Whether the move is made of the keyframes, so that its curves can be bent. */
  get editable() {
    return this.#file === null;
  }

  /** Whether the board has the move that is shown. */
  get uploaded() {
    return this.move !== null && this.#onBoard !== null && same(this.move, this.#onBoard);
  }

  get onBoard() {
    return this.#onBoard;
  }

  get undoable() {
    return this.#before.length > 0;
  }

  /** Everything that does not fit: [{motor, axis, what, at, text}]. */
  get misfits() {
    return this.checked.flatMap(({ motor, axis, misfits: found }) => found.map((each) => ({ motor, axis, ...each })));
  }

  /** Return a motor's step at a frame of the move; undefined if the move has not this motor. */
  at(motor, frame) {
    const index = this.move?.motors.indexOf(motor) ?? -1;
    return index < 0 ? undefined : positionAt(this.move, index, frame);
  }

  /** [first, last] frame of the time line: keyframes have room behind the last one. */
  get domain() {
    const room = Math.max(2, Math.round(this.fps));
    if (!this.editable) return [this.move.startFrame, this.move.endFrame];
    const { all } = this.keys;
    if (!all.length) return [1, 1 + 10 * room];
    const [first, end] = [all[0].frame, all.at(-1).frame];
    return [Math.min(first, 1), end + (all.length > 1 ? Math.max(room, Math.round((end - first) / 10)) : 10 * room)];
  }

  /** Move the preview to a frame. */
  look(frame) {
    const [least, most] = this.domain;
    const wanted = Math.min(Math.max(Math.round(frame), least), most);
    if (wanted === this.see) return;
    this.see = wanted;
    this.dispatchEvent(new Event("see"));
  }

  // ---- changes of the keyframes

  /** Keep the present keyframes for Undo; call it before a change. */
  remember() {
    this.#before.push(this.keys.text(this.fps));
    if (this.#before.length > MOST_UNDONE) this.#before.shift();
  }

  undo() {
    if (!this.#before.length) return;
    this.#takeKeys(this.#before.pop(), "Undo");
    this.#changed();
  }

  /** Change the keyframes by a function. */
  change(doIt) {
    this.remember();
    doIt();
    this.#changed();
  }

  /** The keyframes have changed; dragging: more changes follow at once. */
  touched(dragging) {
    if (dragging) this.#made();
    else this.#changed();
  }

  /** Make the rig's pose a keyframe. */
  put(frame) {
    const { positions } = this.#device.state;
    if (this.keys.motors && this.keys.motors !== positions.length) {
      this.#device.tell(`These keyframes are for ${this.keys.motors} motors, and the device has ${positions.length}.`, true);
      return;
    }
    if (!this.editable) {
      this.#device.tell(`${this.name} is a file without keyframes: under its name, “Keyframes” or “New” begins a move of keyframes.`, true);
      return;
    }
    this.change(() => this.keys.put(frame, positions));
    this.#device.tell(`Frame ${frame} is a keyframe.`);
  }

  /** Show the keyframes instead of the file. */
  useKeys() {
    this.#file = null;
    this.#changed();
  }

  /** Begin a move without keyframes. */
  begin() {
    this.remember();
    for (const key of [...this.keys.all]) this.keys.remove(key);
    this.useKeys();
  }

  #changed() {
    this.refused = null;
    try {
      localStorage.setItem(SAVED, this.keys.text(this.fps));
      localStorage.setItem(SHOWN, this.editable ? "keys" : "file");
    } catch { /* the browser keeps nothing */ }
    this.#made();
    this.dispatchEvent(new Event("edited"));
  }

  /** Make the move of what there is. */
  #made() {
    this.why = "";
    if (this.#file) ({ move: this.move, name: this.name, about: this.about } = this.#file);
    else {
      this.name = "keyframes";
      try {
        this.move = this.keys.toMove(Array.from({ length: this.keys.motors }, (_, i) => this.#device.axes.of(i + 1).name));
        this.about = `frames ${this.move.startFrame} to ${this.move.endFrame} for ${motorCount(this.move)}`;
      } catch (error) {
        this.move = null;
        this.about = "";
        this.why = `No move yet: ${error.message}.`;
      }
    }
    const [least, most] = this.domain;
    this.see = Math.min(Math.max(this.see, least), most);
    this.check();
  }

  /** Compare what the move needs with what is set. */
  check() {
    const { axes, motors } = this.#device;
    this.checked = this.move ? needs(this.move, this.fps).map((need, index) => {
      const motor = this.move.motors[index];
      const [axis, set] = [axes.of(motor), motor <= motors ? this.#device.setOf(motor) : null];
      return { motor, axis, need, set, misfits: misfits(need, set, axis) };
    }) : [];
    this.dispatchEvent(new Event("change"));
  }

  /** Raise the speeds of motors for which the move is too fast, or of one of them. */
  async raise(only = null) {
    const raised = [];
    for (const { motor, axis, need, set } of this.checked) {
      if (!set || (only !== null && motor !== only)) continue;
      const [velocity, acceleration] = ["velocity", "acceleration"].map((what) => {
        const board = this.refused?.motor === motor ? this.refused[what] ?? 0 : 0;
        const wanted = Math.max(need[what], board);
        return wanted > set[what] || board ? Math.min(Math.max(Math.ceil(wanted * SPARE), set[what]), MOST_RATE) : set[what];
      });
      if (velocity === set.velocity && acceleration === set.acceleration) continue;
      if (!(await this.#device.ask("MotorSetSpeed", { motor, velocity, acceleration }))) break;
      await this.#device.seeSettings(motor);
      raised.push(`${axis.name} ${axis.fullRate(velocity, "s")}, ${axis.fullRate(acceleration, "s²")}`);
    }
    this.refused = null;
    this.#device.tell(raised.length ? `Speeds are set: ${raised.join("; ")}.` : "No speed is too low.", raised.length === 0);
    this.check();
  }

  // ---- files

  /** Take a text's keyframes. A mistake is shown, and changes nothing. */
  #takeKeys(text, from) {
    try {
      this.#fps.value = String(this.keys.read(text));
      return true;
    } catch (error) {
      this.#device.tell(`${from}: ${error.message}`, true);
      return false;
    }
  }

  /** Open a file's keyframes. */
  openKeys(text, name) {
    this.remember();
    if (this.#takeKeys(text, name)) {
      this.useKeys();
      this.see = this.move?.startFrame ?? this.see;
      this.dispatchEvent(new Event("opened"));
      this.check();
    } else this.#before.pop();
  }

  /** Take the text of a move, also of another program's file; null: only its bytes are known. */
  async takeText(text, name, bytes = null) {
    try {
      const move = await this.#parse(text, name, bytes);
      if (move.fps !== null) this.#fps.value = String(Number(move.fps.toFixed(3)));
      this.#use(move, name);
      this.recent.add(name, moveText(move));
      this.#changed();
      this.see = move.startFrame;
      this.dispatchEvent(new Event("opened"));
    } catch (error) {
      this.#device.tell(error.message, true);
    }
  }

  #use(move, name) {
    const rate = move.fps ? ` at ${Number(move.fps.toFixed(3))} frames/s` : "";
    this.#file = { move, name, about: `frames ${move.startFrame} to ${move.endFrame}${rate} for ${motorCount(move)}${move.counted && `; ${move.counted}`}` };
  }

  #tryParse(text, name) {
    try {
      this.#use(parseMove(text, name, this.#device.axes), name);
    } catch { /* it was for motors with other names */ }
  }

  /** Return the move in a text. Another program's is read by framestep console, if that serves the page. */
  async #parse(text, name, bytes) {
    try {
      if (text !== null) return parseMove(text, name, this.#device.axes);
      throw Object.assign(new Error(), { foreign: true });
    } catch (error) {
      const { client } = this.#device;
      if (!error.foreign) throw error;
      if (!client?.keeps) throw new Error(`${error.message}; framestep console reads other programs' files`);
      const content = text === null ? { data: btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join("")) } : { text };
      const asked = JSON.stringify({ name, ...content, fps: read(this.#fps) });
      if (asked.length > LONGEST_TEXT) throw new Error(`${name} is too long for this page: framestep import reads it`);
      const { start, motors, names, positions, fps, said } = await client.ask("read_move", { text: asked });
      return { startFrame: start, endFrame: start + positions[0].length - 1, motors, names, positions, fps, counted: said.join("; ") };
    }
  }

  // ---- the board

  /** Note a STOP: an upload ends. */
  stopped() {
    this.#stops += 1;
  }

  /** Upload the move unless the board has it. Return whether the board has it then. */
  async bring() {
    const { move } = this;
    if (!move) {
      this.#device.tell(this.why, true);
      return false;
    }
    if (this.uploaded) return true;
    if (this.uploading !== null) return false;
    const stops = this.#stops;
    const says = (share) => {
      this.uploading = share;
      this.#device.dispatchEvent(new Event("change"));
    };
    says(0);
    this.#onBoard = null;
    try {
      await upload(this.#device, move, says, () => this.#stops !== stops);
      this.#onBoard = move;
      this.#device.tell(`Frames ${move.startFrame} to ${move.endFrame} for ${motorCount(move)} are uploaded.`);
    } catch (error) {
      this.#device.tell(`The upload has ended: ${error.message}`, true);
    }
    this.uploading = null;
    this.dispatchEvent(new Event("change"));
    return this.#onBoard === move;
  }
}

function same(one, other) {
  return one === other || (one.startFrame === other.startFrame && one.endFrame === other.endFrame && one.motors.join() === other.motors.join()
    && one.positions.every((steps, index) => steps.every((step, at) => step === other.positions[index][at])));
}
