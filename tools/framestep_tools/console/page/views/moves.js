// Moves: upload one, see its curves, send the rig to a frame, play it, jog along it.

import { Curve } from "../curve.js";
import { check, field, h, number, read, setText } from "../dom.js";
import { moveText, parseMove, textOf } from "../move_csv.js";
import { MoveNeeds } from "../move_needs.js";
import { PositionStrip } from "../position_strip.js";
import { M } from "../protocol.js";
import { Recent } from "../recent.js";
import { RunOptions } from "../run_options.js";
import { upload } from "../upload.js";

const FARTHEST_FRAME = 1_000_000;
const LONGEST_TEXT = 900_000; // characters of a request that the server takes
const JOG_ALL_KEY = "along the move";

function motorCount({ motors }) {
  return motors.length === 1 ? "1 motor" : `${motors.length} motors`;
}

export class MovesView {
  title = "Moves";
  element = h("section");
  /** The move that this page has uploaded, or null. */
  move = null;
  #device;
  #holds;
  #operation; // the page's operation
  #curve;
  #strip;
  #needs;
  #velocity = number(20_000, 1, 4294967295);
  #acceleration = number(50_000, 1, 4294967295);
  #speeds = h("form", { hidden: true, onsubmit: (event) => this.#setSpeeds(event) },
    field("Velocity of all its motors, steps/s", this.#velocity), field("Acceleration, steps/s²", this.#acceleration),
    h("button", {}, "Set for all its motors"));
  #file = h("input", { type: "file", accept: ".csv,.tsv,.txt,.arcm,.anim,.chan,.bvh,.kup,.asc,.mov,.raw,.xml,.fla,.cart,.aetxt,text/csv" });
  #upload = h("button", { class: "main", disabled: true }, "Upload");
  #progress = h("progress", { max: 1, value: 0, hidden: true, "aria-label": "Upload" });
  #about = h("p", { class: "faint" }, "A CSV file as for framestep upload: a column frame, then a column per motor in steps, headed by its name or number.");
  #recent = new Recent("recent moves", "Uploaded before", (text, name) => this.#takeText(text, name));
  #read = null;
  #name = "";
  #start = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);
  #end = number(240, -FARTHEST_FRAME, FARTHEST_FRAME);
  #fps = number(24, 0.001, 1000, { step: "0.001", inputMode: "decimal" });
  #preroll = number(1000, 0, 60_000);
  #postroll = number(1000, 0, 60_000);
  #loop = h("input");
  #pingPong = h("input");
  #lights = h("input");
  #options = new RunOptions();
  #state = h("p", { role: "status" });
  #go = h("button", { type: "button", class: "main", disabled: true, onclick: () => this.#operation.go() }, "GO");
  #frame = number(1, -FARTHEST_FRAME, FARTHEST_FRAME);

  constructor(device, holds, operation) {
    this.#device = device;
    this.#holds = holds;
    this.#operation = operation;
    this.#curve = new Curve(device.axes);
    this.#strip = new PositionStrip(device);
    this.#needs = new MoveNeeds(device);
    this.#fps.addEventListener("change", () => this.#showNeeds());
    this.#file.addEventListener("change", () => this.#open());
    this.element.append(
      h("form", { class: "card", onsubmit: (event) => this.#send(event) }, field("Move", this.#file), this.#recent.element, this.#upload, this.#progress, this.#about, this.#needs.element, this.#speeds),
      this.#strip.element,
      this.#curve.element,
      h("div", { class: "cards job" }, this.#runCard(), this.#frameCard()),
    );
  }

  connected() {
    this.move = null;
    this.#options.connected(this.#device.state.info);
    this.#upload.disabled = this.#read === null;
    this.#strip.make();
    this.#showNeeds();
  }

  shown() {
    this.#showNeeds(); // speeds may have been set elsewhere
  }

  async #showNeeds() {
    this.#speeds.hidden = this.#read === null;
    const fps = Number(this.#fps.value);
    if (this.#read && fps > 0) await this.#needs.show(this.#read, fps);
  }

  async #setSpeeds(event) {
    event.preventDefault();
    const [velocity, acceleration] = [read(this.#velocity), read(this.#acceleration)];
    if (velocity === null || acceleration === null) return;
    for (const motor of this.#read.motors) {
      if (!(await this.#device.ask("MotorSetSpeed", { motor, velocity, acceleration }))) return;
    }
    this.#device.tell(`The speed of ${motorCount(this.#read)} is set.`);
    await this.#showNeeds();
  }

  render() {
    const { state } = this.#device;
    setText(this.#state, this.#operation.text);
    this.#strip.render();
    this.#go.disabled = !this.#operation.ready;
    if (this.move) this.#curve.at(state.playHead / 1000, state.positions);
  }

  #runCard() {
    return h("article", { class: "card", "aria-label": "Run" },
      h("h2", {}, "Run"),
      h("form", { onsubmit: (event) => this.#prepare(event) },
        field("From frame", this.#start), field("To frame", this.#end, "before the first: backward"),
        field("Frames per second", this.#fps),
        field("Pre-roll, ms", this.#preroll), field("Post-roll, ms", this.#postroll),
        check("Loop", this.#loop), check("Ping-pong", this.#pingPong), check("Uploaded lights and triggers", this.#lights),
        this.#options.element,
        h("button", {}, "Get ready")),
      h("div", { class: "row" }, this.#go,
        h("button", { type: "button", onclick: () => this.#operation.endLoop() }, "End the loop")),
      this.#state);
  }

  #frameCard() {
    const hold = (text, label, toEnd) => this.#holds.button(
      h("button", { type: "button", class: "hold", "aria-label": label }, text),
      JOG_ALL_KEY, this.#jogAll(toEnd), () => this.#device.client && this.#device.ask("MotorStopAll"));
    return h("article", { class: "card", "aria-label": "Frames" },
      h("h2", {}, "Frames"),
      h("form", { onsubmit: (event) => this.#position(event) }, field("Go to frame", this.#frame), h("button", {}, "Go there")),
      h("p", { class: "faint" }, "Hold to jog all motors along the move, at the frames per second of the run. Let go, and they stop on a frame."),
      h("div", { class: "row" }, hold("◀", "Jog along the move, backward", false), hold("▶", "Jog along the move, forward", true)));
  }

  async #open() {
    const [file] = this.#file.files;
    this.#read = null;
    this.#upload.disabled = true;
    if (!file) return;
    try {
      await this.#takeText(await textOf(file), file.name);
    } catch (error) {
      this.#device.tell(error.message, true);
    }
  }

  async #takeText(text, name) {
    try {
      const move = await this.#parse(text, name);
      await this.take(move, name, move.fps);
    } catch (error) {
      this.#device.tell(error.message, true);
    }
  }

  /** Return the move in a text. Another program's is read by framestep console, if that serves the page. */
  async #parse(text, name) {
    try {
      return parseMove(text, name, this.#device.axes);
    } catch (error) {
      const { client } = this.#device;
      if (!error.foreign) throw error;
      if (!client?.keeps) throw new Error(`${error.message}; framestep console reads other programs' files`);
      const asked = JSON.stringify({ name, text, fps: read(this.#fps) });
      if (asked.length > LONGEST_TEXT) throw new Error(`${name} is too long for this page: framestep import reads it`);
      const { start, motors, names, positions, fps, said } = await client.ask("read_move", { text: asked });
      return { startFrame: start, endFrame: start + positions[0].length - 1, motors, names, positions, fps, counted: said.join("; ") };
    }
  }

  /** Show a move, ready to upload. name: where it comes from; fps: at which it is to run, if it says so. */
  async take(move, name, fps = null) {
    if (fps !== null) this.#fps.value = String(fps);
    this.#read = move;
    this.#name = name;
    this.move = null; // the curve no longer shows the device's move
    this.#curve.show(move);
    this.#upload.disabled = !this.#device.connected;
    setText(this.#about, `${name}: frames ${move.startFrame} to ${move.endFrame}${move.fps ? ` at ${Number(move.fps.toFixed(3))} frames/s` : ""} for ${motorCount(move)}${move.counted && `; ${move.counted}`}`);
    [this.#start.value, this.#end.value, this.#frame.value] = [move.startFrame, move.endFrame, move.startFrame];
    await this.#showNeeds();
  }

  async #send(event) {
    event.preventDefault();
    const move = this.#read;
    this.#upload.disabled = true;
    this.#progress.hidden = false;
    try {
      await upload(this.#device, move, (share) => {
        this.#progress.value = share;
      });
      this.move = move;
      this.#recent.add(this.#name, moveText(move));
      this.#device.tell(`Frames ${move.startFrame} to ${move.endFrame} for ${motorCount(move)} are uploaded.`);
    } catch (error) {
      this.#device.tell(`The upload has ended: ${error.message}`, true);
    }
    this.#progress.hidden = true;
    this.#upload.disabled = !this.#device.connected;
  }

  async #prepare(event) {
    event.preventDefault();
    const [start, end, fps, preroll, postroll] = [this.#start, this.#end, this.#fps, this.#preroll, this.#postroll].map(read);
    if ([start, end, fps, preroll, postroll].includes(null)) return;
    const options = this.#options.values((this.#loop.checked ? M.RUN_LOOP : 0) | (this.#pingPong.checked ? M.RUN_PING_PONG : 0));
    if (!options) return;
    await this.#operation.prepare(`Run ${start} to ${end}`, "RtRunMove", {
      fps_milli: Math.round(fps * 1000),
      start_frame: start,
      end_frame: end,
      preroll_ms: preroll,
      postroll_ms: postroll,
      sync_dmx: Number(this.#lights.checked),
      ...options,
    }, this.#loop.checked ? { loops: true } : { last: end });
  }

  async #position(event) {
    event.preventDefault();
    const frame = read(this.#frame);
    if (frame !== null) await this.#device.ask("RtPositionFrame", { frame });
  }

  /** Send a hold's request once; the device goes on by itself until a stop. */
  #jogAll(toEnd) {
    return async () => {
      const [start, end, fps] = [this.#start, this.#end, this.#fps].map(read);
      if ([start, end, fps].includes(null)) throw new RangeError("a field is empty");
      const destination = toEnd ? Math.max(start, end) : Math.min(start, end);
      if (!(await this.#device.ask("RtJogAll", { fps_milli: Math.round(fps * 1000), destination }))) throw new Error("refused");
      return false;
    };
  }
}
