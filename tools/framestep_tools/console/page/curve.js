// A move drawn over its frames: a curve per motor, each on its own scale, and the play head.

import { h, s, setText } from "./dom.js";
import { positionAt } from "./move_csv.js";

const WIDTH = 960;
const HEIGHT = 280;
const LEFT = 12;
const BOTTOM = 24;
const TOP = 10;
const MOST_POINTS = 600; // of a curve; more points than pixels are useless
// Motors differ both by colour and by dashes
const COLOURS = ["#2f7fb8", "#c75a12", "#3c8f4e", "#9a4fb0", "#b0323c", "#7a6a1c", "#2a8f93", "#70757a"];
const DASHES = ["", "8 3", "2 3", "8 3 2 3"];

export class Curve {
  element = h("figure", { class: "card wide" });
  #head = s("line", { y1: TOP, y2: HEIGHT - BOTTOM, stroke: "currentColor", "stroke-width": 2 });
  #caption = h("figcaption", { class: "faint" });
  #move = null;
  #dots = [];
  #ranges = [];
  #axes;

  /** axes: names and units of the motors. */
  constructor(axes) {
    this.#axes = axes;
    this.element.hidden = true;
    axes.addEventListener("change", () => this.#move && this.show(this.#move));
  }

  /** Draw another move. ranges: [lowest, highest] step drawn for each motor; by default those of the move. Returns the drawing. */
  show(move, ranges = rangesOf(move)) {
    this.#move = move;
    this.element.hidden = false;
    this.#ranges = ranges;
    const drawing = s("svg", { class: "drawing", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `The move from frame ${move.startFrame} to ${move.endFrame}` });
    this.#dots = move.motors.map((motor) => s("circle", { r: 5, fill: colour(motor - 1) }));
    drawing.append(...this.#frames(), ...move.motors.map((_, index) => this.#line(index)), this.#head, ...this.#dots);
    this.element.replaceChildren(drawing, this.#legend(), this.#caption);
    this.at(move.startFrame, null);
    return drawing;
  }

  /** Move the play head to a frame, with a dot at each motor's position (null: as uploaded). */
  at(frame, positions) {
    if (!this.#move) return;
    const x = this.x(frame);
    this.#head.setAttribute("x1", x);
    this.#head.setAttribute("x2", x);
    this.#dots.forEach((dot, index) => {
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", this.y(index, positions?.[this.#move.motors[index] - 1] ?? positionAt(this.#move, index, frame)));
    });
    setText(this.#caption, `Play head at frame ${frame.toFixed(3)}. Each motor has a scale of its own.`);
  }

  /** Convert a frame to a place in the drawing, and back. */
  x(frame) {
    const { startFrame, endFrame } = this.#move;
    const share = endFrame > startFrame ? (frame - startFrame) / (endFrame - startFrame) : 0.5;
    return LEFT + Math.min(Math.max(share, -0.01), 1.01) * (WIDTH - 2 * LEFT);
  }

  frameAt(x) {
    const { startFrame, endFrame } = this.#move;
    return startFrame + ((x - LEFT) / (WIDTH - 2 * LEFT)) * (endFrame - startFrame);
  }

  /** Convert a position of the motor with this index in the move to a place in the drawing, and back. */
  y(index, steps) {
    const [low, high] = this.#ranges[index];
    const share = high > low ? (steps - low) / (high - low) : 0.5;
    return HEIGHT - BOTTOM - Math.min(Math.max(share, -0.02), 1.02) * (HEIGHT - BOTTOM - TOP);
  }

  stepsAt(index, y) {
    const [low, high] = this.#ranges[index];
    return low + ((HEIGHT - BOTTOM - y) / (HEIGHT - BOTTOM - TOP)) * (high - low);
  }

  #line(index) {
    const { startFrame, endFrame } = this.#move;
    const motor = this.#move.motors[index] - 1;
    const frames = endFrame - startFrame;
    const every = Math.max(1, Math.ceil(frames / MOST_POINTS));
    const points = [];
    for (let at = 0; at <= frames; at += every) points.push(startFrame + at);
    if (points.at(-1) !== endFrame) points.push(endFrame);
    return s("polyline", {
      fill: "none",
      stroke: colour(motor),
      "stroke-width": 2,
      "stroke-dasharray": DASHES[Math.floor(motor / 2) % DASHES.length],
      points: points.map((frame) => `${this.x(frame).toFixed(1)},${this.y(index, positionAt(this.#move, index, frame)).toFixed(1)}`).join(" "),
    });
  }

  #frames() {
    const { startFrame, endFrame } = this.#move;
    const marks = 8;
    return Array.from({ length: marks + 1 }, (_, i) => {
      const frame = Math.round(startFrame + ((endFrame - startFrame) * i) / marks);
      const end = i === 0 ? "start" : i === marks ? "end" : "middle";
      return s("text", { x: this.x(frame), y: HEIGHT - 6, "text-anchor": end }, String(frame));
    });
  }

  #legend() {
    const ranges = rangesOf(this.#move);
    return h("ul", { class: "legend" }, ...this.#move.names.map((name, index) => {
      const [low, high] = ranges[index];
      const motor = this.#move.motors[index] - 1;
      const swatch = s("svg", { width: 36, height: 10, "aria-hidden": "true" }, s("line", { x1: 0, x2: 36, y1: 5, y2: 5, stroke: colour(motor), "stroke-width": 3, "stroke-dasharray": DASHES[Math.floor(motor / 2) % DASHES.length] }));
      const axis = this.#axes.of(motor + 1);
      const range = axis.scaled ? `${axis.full(low)} to ${axis.full(high)} steps` : `${low} to ${high} steps`;
      return h("li", {}, swatch, ` ${axis.title}${name === axis.name ? "" : `, ${name}`}: ${range}`);
    }));
  }
}

/** Return the lowest and the highest step of each motor, [[low, high]]. */
export function rangesOf(move) {
  return move.positions.map((steps) => steps.reduce(([low, high], step) => [Math.min(low, step), Math.max(high, step)], [steps[0], steps[0]]));
}

/** Return the place of a pointer in a drawing, [x, y]. */
export function placeIn(drawing, event) {
  const { left, top, width, height } = drawing.getBoundingClientRect();
  return [((event.clientX - left) / width) * WIDTH, ((event.clientY - top) / height) * HEIGHT];
}

export function colour(motor) {
  return COLOURS[motor % COLOURS.length];
}
