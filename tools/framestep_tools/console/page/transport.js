// The transport: what GO does (a run, one frame, a time-lapse), its fields, Get ready and GO, the rig along the move.

import { check, field, h, number, read, setText } from "./dom.js";
import { M } from "./protocol.js";
import { RunOptions } from "./run_options.js";

const FARTHEST_FRAME = 1_000_000;
const LARGEST_ANGLE = 32767;
const LONGEST_INTERVAL = 86_400; // s
const JOG_ALL_KEY = "along the move";
const LOOPS = { off: 0, loop: M.RUN_LOOP, "ping-pong": M.RUN_LOOP | M.RUN_PING_PONG, "there and back": M.RUN_PING_PONG };
const SAVED = "shot frames"; // in the browser

const frame = (value) => number(value, -FARTHEST_FRAME, FARTHEST_FRAME);

/** A field with its name inside. label: its full name. */
function inside(text, label, input) {
  input.setAttribute("aria-label", label);
  return h("label", {}, h("span", { "aria-hidden": "true" }, text), input);
}

export class Transport {
  mode = "run";
  /** Number of the take that GO begins. */
  take = 1;
  /** Takes that have ended: [{take, text, good}]. */
  takes = [];
  options = h("div", { class: "parts" });
  #desk;
  #places;
  #fps;
  #start = frame(1);
  #end = frame(240);
  #loop = h("select", {}, ...Object.keys(LOOPS).map((name) => h("option", { value: name }, name)));
  #preroll = number(1000, 0, 60_000);
  #postroll = number(1000, 0, 60_000);
  #lights = h("input");
  #camera = new RunOptions();
  #frame = frame(1);
  #exposure = number(1000, 0, 600_000);
  #open = number(90, -LARGEST_ANGLE, LARGEST_ANGLE);
  #close = number(270, -LARGEST_ANGLE, LARGEST_ANGLE);
  #from = frame(1);
  #to = frame(48);
  #interval = number(10, 0, LONGEST_INTERVAL, { step: "any", inputMode: "decimal" });
  #shot = new Set(JSON.parse(localStorage.getItem(SAVED) ?? "[]"));
  #fields = {};

  /** desk: {forget(): of how the last thing has ended, device, holds, work, operation, series, usable, narrow, page, refuse(text)}; places: the page's elements. */
  constructor(desk, places, fps) {
    this.#desk = desk;
    this.#places = places;
    this.#fps = fps;
    this.#fields = {
      run: [inside("From", "From frame", this.#start), inside("To", "To frame", this.#end), inside("Frames/s", "Frames per second", fps), inside("Loop", "Loop", this.#loop)],
      frames: [inside("Frame", "Frame", this.#frame), inside("Expose, ms", "Exposure, ms", this.#exposure), inside("Opens, °", "Shutter opens at, degrees", this.#open), inside("Closes, °", "Shutter closes at, degrees", this.#close)],
      lapse: [inside("From", "From frame", this.#from), inside("To", "To frame", this.#to), inside("Every, s", "Seconds from picture to picture", this.#interval)],
    };
    for (const [mode, fields] of Object.entries(this.#fields)) places.fields.append(h("div", { "data-mode": mode }, ...fields));
    this.options.append(h("h3", {}, "Before and after the run"), h("div", { class: "row" }, field("Pre-roll, ms", this.#preroll), field("Post-roll, ms", this.#postroll)),
      this.#camera.element, h("h3", {}, "More"), check("Uploaded lights and triggers", this.#lights), desk.keepLine,
      h("h3", {}, "Frames"), h("p", { class: "faint" }, "Motors that are set to move in a shot with motion blur go from half a frame before it to half a frame behind it: 0 to 360° of the shutter. A time-lapse has the exposure and the angles that are set in Frames."),
      h("button", { type: "button", onclick: () => this.#forget() }, "Forget which frames are shot"));
    for (const input of [this.#start, this.#end, this.#from, this.#to]) input.addEventListener("change", () => desk.work.dispatchEvent(new Event("change")));
    for (const button of places.modes.querySelectorAll("button")) button.addEventListener("click", () => this.setMode(button.dataset.mode));
    places.ready.addEventListener("click", () => this.ready());
    places.go.addEventListener("click", () => this.go());
    places.send.addEventListener("click", () => this.send());
    for (const [button, toEnd] of [[places.back, false], [places.forth, true]]) desk.holds.button(button, JOG_ALL_KEY, this.#jogAll(toEnd), () => desk.device.client && desk.device.ask("MotorStopAll"));
    desk.work.addEventListener("opened", () => this.#fit());
    desk.work.addEventListener("change", () => this.#follow());
    desk.operation.addEventListener("over", () => this.#over());
    this.#fit();
    this.setMode("run");
  }

  connected() {
    this.#camera.connected(this.#desk.device.state.info);
  }

  /** [first, last] frame of what GO plays. */
  get range() {
    const ends = { run: [this.#start, this.#end], frames: [this.#frame, this.#frame], lapse: [this.#from, this.#to] }[this.mode];
    return ends.map((input) => Number(input.value));
  }

  /** Frames that are shot, in the modes that shoot; else null. */
  get shot() {
    return this.mode === "run" ? null : this.#shot;
  }

  setMode(mode) {
    this.mode = mode;
    for (const button of this.#places.modes.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
    for (const each of this.#places.fields.children) each.hidden = each.dataset.mode !== mode;
    this.#places.element.setAttribute("aria-label", { run: "Run", frames: "Shoot a frame", lapse: "Time-lapse" }[mode]);
    this.#desk.work.dispatchEvent(new Event("change"));
  }

  nextLoop() {
    const names = Object.keys(LOOPS);
    this.#loop.value = names[(names.indexOf(this.#loop.value) + 1) % names.length];
  }

  /** The frame of the time-lapse's picture of this number, from 0. */
  shotAt(number) {
    const [from, to] = this.range;
    return from + (to < from ? -number : number);
  }

  #known = null; // the ends of the move that the fields have followed

  /** Take the ends of another move. */
  #fit() {
    const { move } = this.#desk.work;
    if (!move) return;
    this.#known = [move.startFrame, move.endFrame];
    [this.#start.value, this.#end.value, this.#frame.value, this.#from.value] = [move.startFrame, move.endFrame, move.startFrame, move.startFrame];
    this.#to.value = move.endFrame;
    this.#desk.work.dispatchEvent(new Event("change"));
  }

  /** Follow the move's ends where the fields had them before. */
  #follow() {
    const { move } = this.#desk.work;
    if (!move) return;
    const [first, last] = this.#known ?? [null, null];
    if (move.startFrame === first && move.endFrame === last) return;
    this.#known = [move.startFrame, move.endFrame];
    for (const [input, before, now] of [[this.#start, first, move.startFrame], [this.#from, first, move.startFrame], [this.#end, last, move.endFrame], [this.#to, last, move.endFrame]]) {
      if (before === null || Number(input.value) === before) input.value = now;
    }
  }

  #forget() {
    this.#shot.clear();
    localStorage.removeItem(SAVED);
    this.#desk.work.dispatchEvent(new Event("change"));
  }

  #note(frames) {
    for (const each of frames) this.#shot.add(each);
    localStorage.setItem(SAVED, JSON.stringify([...this.#shot]));
    this.#desk.work.dispatchEvent(new Event("change"));
  }

  #over() {
    const { operation, device, series } = this.#desk;
    if (this.#running === "frame" && !operation.early) this.#note([this.#shooting]);
    if (this.#running === "run") {
      const at = (device.state.playHead / 1000).toFixed(3);
      this.takes.unshift({ take: this.take, good: !operation.early, text: operation.early ? `${operation.name}: stopped at ${at}` : `${operation.name}: complete` });
      this.take += 1;
    }
    if (!series.goesOn) this.#running = null;
  }

  #running = null; // "run", "frame" or "lapse"
  #shooting = 0; // the frame of the shot

  // ---- deeds

  /** Bring the rig and the board to where GO can begin. */
  async ready() {
    const { operation, work } = this.#desk;
    if (this.#places.ready.disabled) return;
    this.#desk.forget();
    if (operation.loops) {
      await operation.endLoop();
      return;
    }
    if (this.mode === "frames") {
      const at = read(this.#frame);
      if (at === null) return;
      this.#frame.value = String(at + 1);
      work.look(at + 1);
      work.dispatchEvent(new Event("change"));
      await this.#rigTo(at + 1);
    } else if (this.mode === "lapse") {
      const at = read(this.#from);
      if (at !== null) await this.#rigTo(at);
    } else await this.#prepareRun();
  }

  async #prepareRun() {
    const { work } = this.#desk;
    const [start, end, fps, preroll, postroll] = [this.#start, this.#end, this.#fps, this.#preroll, this.#postroll].map(read);
    if ([start, end, fps].includes(null)) return;
    const loop = LOOPS[this.#loop.value];
    const options = this.#camera.values(loop);
    if (!options || preroll === null || postroll === null) {
      this.#desk.drawer("options", true);
      return;
    }
    if (!(await work.bring())) return;
    work.look(start);
    const loops = (loop & M.RUN_LOOP) !== 0;
    const values = { fps_milli: Math.round(fps * 1000), start_frame: start, end_frame: end, preroll_ms: preroll, postroll_ms: postroll, sync_dmx: Number(this.#lights.checked), ...options };
    const last = loop ? null : end;
    if (await this.#desk.operation.prepare(`Run ${start} to ${end}`, "RtRunMove", values, loops ? { loops: true } : { last })) this.#running = "run";
  }

  async go() {
    const { operation } = this.#desk;
    if (this.#places.go.disabled) return;
    this.#desk.forget();
    this.#places.go.blur(); // so that no key presses it again
    if (this.mode === "run" || operation.ready) await operation.go();
    else if (this.mode === "frames") await this.#shoot();
    else await this.#shootAll();
  }

  /** Return what is the same for every shot, or null for a wrong field. */
  #shotValues() {
    const [exposure, open, close] = [this.#exposure, this.#open, this.#close].map(read);
    if ([exposure, open, close].includes(null)) {
      this.setMode("frames");
      return null;
    }
    return { exposure_ms: exposure, open_angle: open, close_angle: close, motors: [] };
  }

  /** Shoot one frame: the motors go to where it begins, then through it. */
  async #shoot() {
    const { operation, work } = this.#desk;
    const at = read(this.#frame);
    const shot = this.#shotValues();
    if (at === null || !shot || !(await work.bring())) return;
    if (!(await this.#desk.operation.prepare(`The shot of frame ${at}`, "RtShootFrame2", { frame: at, ...shot }))) return;
    [this.#running, this.#shooting] = ["frame", at];
    work.look(at);
    await new Promise((resolve) => {
      const look = () => {
        if (operation.going) return;
        operation.removeEventListener("change", look);
        resolve();
      };
      operation.addEventListener("change", look);
      look();
    });
    if (operation.ready) await operation.go();
  }

  async #shootAll() {
    const { series, work } = this.#desk;
    const [from, to, seconds] = [this.#from, this.#to, this.#interval].map(read);
    const shot = this.#shotValues();
    if ([from, to, seconds].includes(null) || !shot || !(await work.bring())) return;
    const step = to < from ? -1 : 1;
    const frames = Array.from({ length: Math.abs(to - from) + 1 }, (_, i) => from + step * i);
    this.#running = "lapse";
    await series.shoot(frames, seconds * 1000, (at) => {
      work.look(at);
      return { frame: at, ...shot };
    }, (at) => this.#note([at]));
    this.#running = null;
  }

  /** Send the rig to the frame of the preview. */
  async send() {
    if (this.#places.send.disabled) return;
    this.#desk.forget();
    await this.#rigTo(this.#desk.work.see);
  }

  async #rigTo(at) {
    if (await this.#desk.work.bring()) await this.#desk.device.ask("RtPositionFrame", { frame: at });
  }

  /** Send a hold's request once; the device goes on by itself until a stop. */
  #jogAll(toEnd) {
    return async () => {
      const [start, end, fps] = [this.#start, this.#end, this.#fps].map(read);
      if ([start, end, fps].includes(null)) throw new RangeError("a field is empty");
      const destination = toEnd ? Math.max(start, end) : Math.min(start, end);
      if (!(await this.#desk.device.ask("RtJogAll", { fps_milli: Math.round(fps * 1000), destination }))) throw new Error("refused");
      return false;
    };
  }

  // ---- what is shown

  render() {
    const { device, operation, series, work, usable, narrow, page } = this.#desk;
    const { ready, go, send, count, countOf, back, forth, play } = this.#places;
    const moving = device.state.moving !== 0;
    const shoots = this.mode !== "run";
    const { blocked } = this.#desk;
    const can = usable && !blocked && !operation.busy && !moving && !series.goesOn && work.move !== null && work.uploading === null && (!shoots || device.can(M.CAP_GO_MOTION2));
    const [first] = this.range;
    const words = {
      run: ["Get ready", `to frame ${first}`, "GO", `take ${this.take}`],
      frames: ["Next frame", `to ${first + 1}`, "SHOOT", `frame ${first}`],
      lapse: ["Get ready", `to frame ${first}`, "START", `${Math.abs(this.range[1] - first) + 1} pictures`],
    }[this.mode];
    const away = narrow && page !== "take";
    const canGo = !away && usable && (operation.ready && !series.goesOn ? true : shoots && can);
    const plays = operation.playing || series.goesOn;
    const laps = operation.loops;
    label(ready, laps ? "Last lap" : words[0], laps ? "then it ends" : words[1]);
    ready.disabled = !usable || !(laps || can);
    const fits = work.misfits.length === 0;
    ready.classList.toggle("next", can && !operation.ready && this.mode !== "frames" && fits && !laps);
    const head = device.state.playHead / 1000;
    label(go, plays ? "RUNS" : words[2], plays ? `frame ${Math.floor(head)}` : canGo ? words[3] : this.#why(can, away, fits));
    go.disabled = !canGo;
    go.classList.toggle("next", canGo);
    go.classList.toggle("plays", plays);
    setText(count, device.connected ? head.toFixed(3) + (this.#desk.blind ? "?" : "") : "–");
    setText(countOf, work.move ? `/ ${work.move.endFrame}` : "");
    setText(send.lastChild, String(work.see));
    send.disabled = !can && !(usable && operation.ready && work.uploaded);
    for (const button of [back, forth]) button.disabled = !usable || blocked !== "" || operation.busy || !work.uploaded || series.goesOn;
    play.disabled = operation.playing || !work.move;
  }

  /** Say why GO cannot. */
  #why(can, away, fits) {
    const { device, operation, work, usable } = this.#desk;
    if (!usable) return device.connected ? "not now" : "";
    if (away) return "under Take";
    if (this.#desk.blocked) return this.#desk.blocked;
    if (operation.going) return "on the way…";
    if (!work.move) return "no move yet";
    if (work.uploading !== null) return "uploading…";
    if (this.mode !== "run" && !device.can(M.CAP_GO_MOTION2)) return "this device cannot";
    if (!fits) return "the move does not fit";
    return can || this.mode === "run" ? "get ready first" : "motors move";
  }
}

/** Put a word and a smaller one below it into a button. */
function label(button, text, small) {
  setText(button.firstChild, text);
  setText(button.lastChild, small);
}
