// The time line: the move's frames, the band of the run, a curve for each motor on its own scale, the chosen motor's handles
// and speed, the keyframes. Two heads: the preview, which a pointer drags, and the rig's.

import { s, setText, withPicture } from "./dom.js";
import { WAYS } from "./keyframes.js";
import { color } from "./motors.js";
import { positionAt } from "./move_csv.js";

const MOST_POINTS = 600; // of a curve; more points than pixels are useless
const SPARE = 0.06; // of a motor's range, free above and below
const THIRD = 1 / 3; // of the way to the next keyframe: where a Bezier curve has its handle
const CLOSEST = 0.1; // frames from a keyframe to its handle
const TOP_SPEED = 1.3; // highest share of what is set in the lane of the speed
const MEND = 176; // room for the button that raises a speed
const TARGET = 22; // half of a touch target
const ORDER = Object.keys(WAYS);
const WORDS = { cubic: "smooth", ease: "ease", linear: "straight", hold: "hold" };

const clamp = (value, least, most) => Math.min(Math.max(value, least), most);

export class Timeline {
  #svg;
  #desk;
  #work;
  #geo = null;
  #ranges = []; // [lowest, highest] step drawn for each motor of the move
  #held = null; // the ranges while something is dragged, or the drawing would run away
  #only = false; // only the chosen motor's curve
  #heads = {};
  #drag = null; // called with [x, y] of the pointer
  #dots = [];

  /** desk: {device, work, transport, narrow, page}. */
  constructor(svg, desk) {
    this.#svg = svg;
    this.#desk = desk;
    this.#work = desk.work;
    for (const name of ["change", "chosen"]) this.#work.addEventListener(name, () => this.redraw());
    this.#work.addEventListener("see", () => this.heads());
    new ResizeObserver(() => this.redraw()).observe(svg);
    svg.addEventListener("pointerdown", (event) => this.#begin(event));
    svg.addEventListener("pointermove", (event) => this.#drag?.(...this.#place(event)));
    for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => this.#end());
  }

  /** Show only the chosen motor's curve, or all. */
  set only(on) {
    this.#only = on;
    this.redraw();
  }

  /** Draw with the next picture. */
  redraw = withPicture(() => this.draw());

  // ---- the drawing

  draw() {
    const { width: w, height: h } = this.#svg.getBoundingClientRect();
    if (!w || h < 40) return;
    const { move } = this.#work;
    this.#svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
    this.#svg.setAttribute("aria-label", move ? `The move from frame ${move.startFrame} to ${move.endFrame}` : "There is no move yet");
    this.#measure(w, h);
    const drawn = move ? [...this.#curves(), ...this.#speedLane()] : this.#hint();
    this.#svg.replaceChildren(...this.#frames(), ...drawn, ...this.#keys(), ...this.#makeHeads());
    this.heads();
  }

  /** Say how a move begins. */
  #hint() {
    const { w, top, bottom } = this.#geo;
    const [key] = this.#work.keys.all;
    const lines = key ? [`Frame ${key.frame} is a keyframe.`, "Drag the preview to another frame, jog, press ◆ Key."]
      : ["No move yet.", this.#desk.narrow ? "Jog to a pose, then press ◆ Key." : "Jog the rig to a pose and press ◆ Key, or open a move: press its name above."];
    return lines.map((text, i) => s("text", { class: "empty", x: w / 2, y: (top + bottom) / 2 - 6 + 22 * i }, text));
  }

  #measure(w, h) {
    const [f0, f1] = this.#work.domain;
    const small = h < 230 || w < 500;
    const take = this.#desk.narrow && this.#desk.page === "take";
    const [left, right] = [small ? 26 : 62, 24];
    const ruler = small && take ? 40 : 54;
    const lane = small ? 0 : clamp(h * 0.17, 40, 80);
    const strip = take ? 22 : 44;
    const [top, bottom] = [ruler + 8, h - strip - lane - 8];
    const across = w - left - right;
    this.#geo = {
      w, h, f0, f1, small, take, left, right, ruler, lane, strip, top, bottom,
      x: (frame) => left + (f1 > f0 ? clamp((frame - f0) / (f1 - f0), -0.01, 1.01) : 0.5) * across,
      frame: (x) => f0 + ((x - left) / across) * (f1 - f0),
    };
    this.#ranges = this.#held ?? this.#work.checked.map(({ need }) => {
      const spare = Math.max((need.highest - need.lowest) * SPARE, 5);
      return [need.lowest - spare, need.highest + spare];
    });
  }

  #y(index, steps) {
    const [low, high] = this.#ranges[index] ?? [0, 1];
    const { top, bottom } = this.#geo;
    const share = clamp((steps - low) / (high - low || 1), -0.02, 1.02);
    return this.#inverted(index) ? top + share * (bottom - top) : bottom - share * (bottom - top);
  }

  #stepsAt(index, y) {
    const [low, high] = this.#ranges[index];
    const { top, bottom } = this.#geo;
    return low + (this.#inverted(index) ? (y - top) : (bottom - y)) / (bottom - top) * (high - low);
  }

  /** Whether the motor counts down while its position rises: up is still up. */
  #inverted(index) {
    return this.#axis(index).perUnit < 0;
  }

  #axis(index) {
    return this.#desk.device.axes.of(this.#work.move.motors[index]);
  }

  /** Index in the move of the chosen motor; -1 if the move has it not. */
  get #index() {
    return this.#work.move?.motors.indexOf(this.#work.chosen) ?? -1;
  }

  /** Frames with a number: at most `count`, at round distances. */
  #marks(count) {
    const { f0, f1 } = this.#geo;
    const { fps } = this.#work;
    const raw = Math.max(1, (f1 - f0) / count);
    const second = Math.round(fps);
    const rounds = [1, 2, 5, 10, Math.round(second / 2), second, 2 * second, 5 * second, 10 * second, 30 * second, 60 * second, 300 * second, 600 * second].filter((each) => each > 0).sort((a, b) => a - b);
    const every = rounds.find((each) => each >= raw) ?? Math.ceil(raw);
    const found = [f0];
    for (let frame = Math.ceil((f0 + every / 2) / every) * every; frame < f1 - every / 2; frame += every) if (frame > f0) found.push(frame);
    if (f1 > f0) found.push(f1);
    return found;
  }

  #frames() {
    const { w, h, f0, x, ruler, strip, right } = this.#geo;
    const [from, to] = this.#desk.transport.range;
    const [begin, end] = [x(Math.min(from, to)), x(Math.max(from, to))];
    const out = this.#work.move ? [s("rect", { class: "range", x: begin, y: ruler - 20, width: Math.max(0, end - begin), height: 20 })] : [];
    const { shot } = this.#desk.transport;
    if (shot) {
      const cell = x(f0 + 1) - x(f0);
      for (const frame of shot) out.push(s("rect", { class: "shot", x: x(frame) - cell / 2, y: ruler - 20, width: Math.max(cell - 0.6, 1), height: 20 }));
      out.push(s("text", { class: "band-text", x: w - right - 6, y: ruler - 5, "text-anchor": "end" }, `${shot.size} shot`));
    }
    for (const frame of this.#marks(w > 560 ? 11 : 5)) {
      out.push(s("line", { class: "grid", x1: x(frame), x2: x(frame), y1: ruler, y2: h - strip }), s("text", { x: x(frame), y: 14, "text-anchor": "middle" }, String(frame)));
      if (ruler >= 54) out.push(s("text", { class: "time", x: x(frame), y: 27, "text-anchor": "middle" }, `${((frame - f0) / this.#work.fps).toFixed(1)} s`));
    }
    return out;
  }

  #curves() {
    const { move, checked } = this.#work;
    const { x, w, right, bottom, small } = this.#geo;
    const { endFrame: f1 } = move;
    const chosen = this.#index;
    const order = move.motors.map((_, index) => index).filter((index) => index !== chosen && !this.#only);
    if (chosen >= 0) order.push(chosen);
    const frames = this.#sampled();
    const out = order.map((index) => s("polyline", {
      class: index === chosen ? "curve chosen" : "curve",
      stroke: color(move.motors[index]),
      "stroke-dasharray": index % 2 && index !== chosen ? "7 3" : "",
      points: frames.map((frame) => `${x(frame).toFixed(1)},${this.#y(index, positionAt(move, index, frame)).toFixed(1)}`).join(" "),
    }));
    for (const index of order) out.push(...this.#over(index));
    if (!small && chosen >= 0) {
      const { need, axis } = checked[chosen];
      for (const steps of new Set([need.lowest, (need.lowest + need.highest) / 2, need.highest])) out.push(s("text", { x: 6, y: this.#y(chosen, steps) + 4 }, axis.brief(steps)));
    }
    const ends = order.map((index) => ({ index, y: this.#y(index, positionAt(move, index, f1)) + 4 })).sort((a, b) => a.y - b.y);
    for (let k = 1; k < ends.length; k += 1) ends[k].y = Math.max(ends[k].y, ends[k - 1].y + 13);
    if (ends.length && ends.at(-1).y > bottom + 6) {
      ends.at(-1).y = bottom + 6;
      for (let k = ends.length - 2; k >= 0; k -= 1) ends[k].y = Math.min(ends[k].y, ends[k + 1].y - 13);
    }
    out.push(...ends.map(({ index, y }) => s("text", { class: index === chosen ? "end chosen" : "end", x: w - right + 8, y, style: `fill: ${color(move.motors[index])}` }, String(move.motors[index]))));
    return out;
  }

  /** Frames at which curves are drawn. */
  #sampled() {
    const { startFrame: f0, endFrame: f1 } = this.#work.move;
    const every = Math.max(1, Math.ceil((f1 - f0) / MOST_POINTS));
    const frames = [];
    for (let frame = f0; frame < f1; frame += every) frames.push(frame);
    return [...frames, f1];
  }

  /** Mark where a motor is too fast, or beyond its limits. */
  #over(index) {
    const { move, fps, checked } = this.#work;
    const { misfits, set } = checked[index];
    if (!misfits.length) return [];
    const { x } = this.#geo;
    const { startFrame: f0 } = move;
    const steps = move.positions[index];
    const points = [];
    const out = [];
    const put = () => {
      if (points.length > 1) out.push(s("polyline", { class: "over", points: points.map((frame) => `${x(frame).toFixed(1)},${this.#y(index, positionAt(move, index, frame)).toFixed(1)}`).join(" ") }));
      points.length = 0;
    };
    if (set && misfits.some(({ what }) => what === "velocity")) {
      for (let at = 1; at < steps.length; at += 1) {
        if (Math.abs(steps[at] - steps[at - 1]) * fps > set.velocity) points.push(f0 + at - 1, f0 + at);
        else put();
      }
      put();
    }
    return [...out, ...misfits.map(({ at }) => s("circle", { class: "misfit", cx: x(at), cy: this.#y(index, positionAt(move, index, at)), r: 6 }))];
  }

  /** The chosen motor's speed as a share of what is set. */
  #speedLane() {
    const { w, h, x, left, right, lane, strip } = this.#geo;
    const index = this.#index;
    if (!lane || index < 0) return [];
    const { move, fps, checked } = this.#work;
    const { startFrame: f0, endFrame: f1 } = move;
    const { need, set, axis, motor, misfits } = checked[index];
    const steps = move.positions[index];
    const most = set?.velocity ?? Math.max(need.velocity, 1);
    const top = h - strip - lane;
    const y = (share) => top + lane - 2 - (clamp(share, 0, TOP_SPEED) * (lane - 6)) / TOP_SPEED;
    const every = Math.max(1, Math.ceil(steps.length / MOST_POINTS));
    const points = [];
    for (let at = 0; at < steps.length; at += every) {
      let fastest = 0;
      for (let i = Math.max(at, 1); i < Math.min(at + every, steps.length); i += 1) fastest = Math.max(fastest, Math.abs(steps[i] - steps[i - 1]));
      if (at === 0 && every === 1 && steps.length > 1) fastest = Math.abs(steps[1] - steps[0]);
      points.push([x(f0 + at), y((fastest * fps) / most), fastest * fps > most]);
    }
    const line = (list, props) => s("polyline", { points: list.map(([a, b]) => `${a.toFixed(1)},${b.toFixed(1)}`).join(" "), ...props });
    const rate = (value) => axis.short(axis.rate(value));
    const [worst] = misfits;
    const said = worst ? `${axis.name}: ${worst.text} at frame ${worst.at}` : `${axis.name}: at most ${rate(need.velocity)}${set ? ` of ${axis.withUnit(rate(set.velocity), "/s")}` : ` ${axis.unit}/s`}, at frame ${need.velocityAt}`;
    return [
      s("rect", { class: "lane", x: 0, y: top, width: w, height: lane }),
      s("line", { class: "limit", x1: left, x2: w - right, y1: y(1), y2: y(1) }),
      s("text", { x: 6, y: y(1) + 4 }, "100 %"), s("text", { x: 6, y: top + lane - 4 }, "speed"),
      line(points, { class: "curve", stroke: color(motor) }),
      line(points.filter(([, , over]) => over), { class: "over" }),
      s("text", { class: worst ? "said bad" : "said", x: w - right - 4 - (misfits.some(({ what }) => what !== "limit") ? MEND : 0), y: top + 13, "text-anchor": "end" }, said),
    ].filter((each) => f1 > f0 || each.tagName !== "polyline");
  }

  /** Diamonds, the words between them, and the chosen motor's squares and handles. */
  #keys() {
    if (!this.#work.editable) return [];
    const { h, x, strip, small, take } = this.#geo;
    const { keys, see } = this.#work;
    const { all } = keys;
    const middle = h - strip / 2;
    const index = this.#index;
    const out = [];
    all.forEach((key, at) => {
      const next = all[at + 1];
      if (next && strip > 30) {
        const wide = x(next.frame) - x(key.frame);
        out.push(s("line", { class: "grid", x1: x(key.frame) + 12, x2: x(next.frame) - 12, y1: middle + 10, y2: middle + 10 }));
        if (wide > 90) out.push(s("text", { class: "way", x: (x(key.frame) + x(next.frame)) / 2, y: middle + 3 }, WORDS[key.way]));
        if (wide > 2 * TARGET) out.push(s("rect", { class: "hit", "data-way": at, x: x(key.frame) + TARGET, y: h - strip, width: wide - 2 * TARGET, height: strip }, s("title", {}, `${WAYS[key.way]}: press for the next way`)));
      }
    });
    const r = strip > 30 ? 9 : 6;
    for (const [at, key] of all.entries()) {
      out.push(s("path", { class: key.frame === see ? "diamond at" : "diamond", d: `M${x(key.frame)} ${middle - r}l${r} ${r}l${-r} ${r}l${-r} ${-r}z` }),
        s("rect", { class: "hit", "data-diamond": at, x: x(key.frame) - TARGET, y: h - strip, width: 2 * TARGET, height: strip }));
    }
    if (index < 0 || (take && small)) return out;
    for (const [at, key] of all.entries()) for (const side of [-1, 1]) out.push(...this.#handle(at, key, index, side));
    for (const [at, key] of all.entries()) {
      const y = this.#y(index, key.steps[index]);
      out.push(s("rect", { class: "key", x: x(key.frame) - 7, y: y - 7, width: 14, height: 14, fill: color(index + 1), "data-pose": at }));
    }
    return out;
  }

  /** The handle behind (side 1) or before (-1) a keyframe, where the curve is smooth. */
  #handle(at, key, motor, side) {
    const { all } = this.#work.keys;
    const next = all[at + side];
    if (!next || (side > 0 ? key : next).way !== "cubic") return [];
    const { x } = this.#geo;
    const frames = (next.frame - key.frame) * THIRD;
    const from = [x(key.frame), this.#y(motor, key.steps[motor])];
    const to = [x(key.frame + frames), this.#y(motor, key.steps[motor] + frames * this.#work.keys.slope(at, motor))];
    return [
      s("line", { class: "handle-line", x1: from[0], y1: from[1], x2: to[0], y2: to[1] }),
      s("circle", { class: "handle", cx: to[0], cy: to[1], r: 6, "data-handle": at, "data-side": side }),
    ];
  }

  #makeHeads() {
    const { h, ruler } = this.#geo;
    const make = (name, wide, y) => {
      const text = s("text", { class: `${name}-text`, y: y + 13, "text-anchor": "middle" });
      const flag = s("rect", { class: `${name}-flag`, width: wide, height: 18, y, rx: 4 });
      const group = s("g", { class: `head-${name}` }, s("line", { class: `${name}-line`, x1: 0, x2: 0, y1: y + 17, y2: h }), flag, text);
      this.#heads[name] = { group, flag, text, wide };
      return group;
    };
    this.#dots = (this.#work.move?.motors ?? []).map((motor) => s("circle", { class: "dot", r: 4, fill: color(motor) }));
    return [...this.#dots, make("preview", 48, 1), make("rig", 76, ruler - 19)];
  }

  /** Put the heads where the preview and the rig are. */
  heads() {
    if (!this.#geo) return;
    const { x, w } = this.#geo;
    const { device, operation, blind } = this.#desk;
    const { state } = device;
    const put = (name, frame, text, shown) => {
      const { group, flag, text: label, wide } = this.#heads[name];
      group.style.display = shown ? "" : "none";
      const at = x(frame);
      group.setAttribute("transform", `translate(${at.toFixed(2)} 0)`);
      const shift = clamp(at, wide / 2, w - wide / 2) - at;
      flag.setAttribute("x", shift - wide / 2);
      label.setAttribute("x", shift);
      setText(label, text);
    };
    put("preview", this.#work.see, String(this.#work.see), !operation.playing);
    const head = state.playHead / 1000;
    const onRig = device.connected && this.#work.uploaded && !device.silent;
    put("rig", head, `rig ${head.toFixed(0)}${blind ? "?" : ""}`, onRig);
    const motors = this.#work.move?.motors ?? []; // may have changed since the dots were made
    this.#dots.forEach((dot, index) => {
      const steps = state.positions[motors[index] - 1];
      dot.style.display = onRig && steps !== undefined && (!this.#only || index === this.#index) ? "" : "none";
      if (steps === undefined) return;
      dot.setAttribute("cx", x(head));
      dot.setAttribute("cy", this.#y(index, steps));
    });
    const at = String(this.#work.keys.all.findIndex((key) => key.frame === this.#work.see));
    const diamonds = this.#svg.querySelectorAll(".diamond");
    diamonds.forEach((diamond, i) => diamond.classList.toggle("at", String(i) === at));
  }

  // ---- the pointer

  #place(event) {
    const { left, top } = this.#svg.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  /** Return the square or handle that a finger means: the nearest one within its target. */
  #nearest({ pointerType, clientX, clientY }) {
    if (pointerType !== "touch") return null;
    const marks = [...this.#svg.querySelectorAll("[data-pose], [data-handle]")].map((mark) => {
      const { x, y, width, height } = mark.getBoundingClientRect();
      return [Math.hypot(x + width / 2 - clientX, y + height / 2 - clientY), mark];
    }).sort(([one], [other]) => one - other);
    return marks.length && marks[0][0] <= TARGET ? marks[0][1] : null;
  }

  #begin(event) {
    if (event.button !== 0 || !this.#geo) return;
    event.preventDefault();
    this.#svg.setPointerCapture(event.pointerId);
    const { way, diamond, pose, handle, side } = (this.#nearest(event) ?? event.target).dataset;
    const { all } = this.#work.keys;
    if (way !== undefined) this.#work.change(() => { all[way].way = ORDER[(ORDER.indexOf(all[way].way) + 1) % ORDER.length]; });
    else if (diamond !== undefined) this.#work.look(all[diamond].frame);
    else if (pose !== undefined) this.#drags((x, y) => this.#moveKey(all[pose], x, y));
    else if (handle !== undefined) this.#drags((x, y) => this.#bend(Number(handle), Number(side), x, y));
    else if (!this.#desk.operation.playing) {
      this.#drag = (x) => this.#work.look(this.#geo.frame(x));
      this.#drag(...this.#place(event));
    }
  }

  /** Let a mark be dragged. The drawing is made again at each step. */
  #drags(to) {
    this.#held = this.#ranges;
    this.#work.remember();
    this.#drag = (x, y) => {
      to(x, y);
      this.#work.touched(true);
    };
    this.#drag.changes = true;
  }

  #end() {
    const { changes } = this.#drag ?? {};
    this.#drag = null;
    this.#held = null;
    if (changes) this.#work.touched(false);
  }

  #moveKey(key, x, y) {
    const { all } = this.#work.keys;
    const motor = this.#index;
    key.steps[motor] = Math.round(this.#stepsAt(motor, y));
    // The ends stay, since the drawing begins and ends with them.
    if (key === all[0] || key === all.at(-1)) return;
    const at = all.indexOf(key);
    this.#work.keys.shift(key, Math.round(clamp(this.#geo.frame(x), all[at - 1].frame + 1, all[at + 1].frame - 1)));
  }

  #bend(at, side, x, y) {
    const key = this.#work.keys.all[at];
    const motor = this.#index;
    const away = side * Math.max(side * (this.#geo.frame(x) - key.frame), CLOSEST);
    key.slopes[motor] = (this.#stepsAt(motor, y) - key.steps[motor]) / away;
  }
}
