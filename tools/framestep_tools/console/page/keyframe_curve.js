// The curves through keyframes, with marks that can be dragged: a dot for each pose of one motor, and handles for its slopes.

import { Curve, colour, placeIn, rangesOf } from "./curve.js";
import { s } from "./dom.js";

const SPARE = 0.15; // of a motor's range, free above and below
const LEAST_SPARE = 10; // steps
const THIRD = 1 / 3; // of the way to the next keyframe: where a Bezier curve has its handle
const CLOSEST = 0.1; // frames from a keyframe to its handle

export class KeyframeCurve {
  #curve;
  #keyframes;
  #changed;
  #ranges = null; // stay while something is dragged, or the drawing would run away

  /** axes: names and units; keyframes: a Keyframes; changed(dragging): called after each change, and once at its beginning. */
  constructor(axes, keyframes, changed) {
    this.#curve = new Curve(axes);
    this.#keyframes = keyframes;
    this.#changed = changed;
  }

  get element() {
    return this.#curve.element;
  }

  at(frame, positions) {
    this.#curve.at(frame, positions);
  }

  /** Draw a move of these keyframes (null: none) with the marks of a motor, from 0. */
  show(move, motor) {
    this.element.hidden = move === null;
    if (!move) return;
    const ranges = this.#ranges ?? rangesOf(move).map(([low, high]) => {
      const spare = Math.max((high - low) * SPARE, LEAST_SPARE);
      return [low - spare, high + spare];
    });
    const drawing = this.#curve.show(move, ranges);
    const keys = this.#keyframes.all;
    drawing.append(...keys.flatMap((key, at) => [
      ...this.#handle(drawing, at, motor, ranges, -1),
      ...this.#handle(drawing, at, motor, ranges, 1),
      this.#dot(drawing, key, motor, ranges),
    ]));
  }

  #dot(drawing, key, motor, ranges) {
    const dot = s("rect", { class: "key", x: this.#curve.x(key.frame) - 7, y: this.#curve.y(motor, key.steps[motor]) - 7, width: 14, height: 14, fill: colour(motor) });
    this.#drags(dot, drawing, ranges, (x, y) => {
      key.steps[motor] = Math.round(this.#curve.stepsAt(motor, y));
      // The ends stay, since the drawing begins and ends with them.
      const { all } = this.#keyframes;
      if (key !== all[0] && key !== all.at(-1)) {
        const at = all.indexOf(key);
        this.#keyframes.shift(key, Math.round(Math.min(Math.max(this.#curve.frameAt(x), all[at - 1].frame + 1), all[at + 1].frame - 1)));
      }
    });
    return dot;
  }

  /** The handle behind (side 1) or before (-1) a keyframe, where the curve is smooth. */
  #handle(drawing, at, motor, ranges, side) {
    const { all } = this.#keyframes;
    const [key, next] = [all[at], all[at + side]];
    if (!next || (side > 0 ? key : next).way !== "cubic") return [];
    const frames = (next.frame - key.frame) * THIRD;
    const from = [this.#curve.x(key.frame), this.#curve.y(motor, key.steps[motor])];
    const to = [this.#curve.x(key.frame + frames), this.#curve.y(motor, key.steps[motor] + frames * this.#keyframes.slope(at, motor))];
    const line = s("line", { x1: from[0], y1: from[1], x2: to[0], y2: to[1], stroke: "currentColor", "stroke-width": 1 });
    const end = s("circle", { class: "handle", cx: to[0], cy: to[1], r: 6, fill: "currentColor" });
    this.#drags(end, drawing, ranges, (x, y) => {
      const away = side * Math.max(side * (this.#curve.frameAt(x) - key.frame), CLOSEST);
      key.slopes[motor] = (this.#curve.stepsAt(motor, y) - key.steps[motor]) / away;
    });
    return [line, end];
  }

  /** Let a mark be dragged. The drawing, and the mark in it, are made again at each step, so the window has the events. */
  #drags(mark, drawing, ranges, to) {
    mark.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      this.#ranges = ranges;
      this.#changed("begin");
      const box = { getBoundingClientRect: () => this.element.querySelector("svg").getBoundingClientRect() };
      const move = (moved) => {
        to(...placeIn(box, moved));
        this.#changed("drag");
      };
      const end = () => {
        window.removeEventListener("pointermove", move);
        for (const name of ["pointerup", "pointercancel"]) window.removeEventListener(name, end);
        this.#ranges = null;
        this.#changed("end");
      };
      window.addEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) window.addEventListener(name, end);
    });
  }
}
