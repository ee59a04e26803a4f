// The rig from above and from the side: arm, camera, the camera's past path, and the path of the uploaded move.

import { h, s } from "./dom.js";
import { pose } from "./kinematics.js";

const SIZE = 420;
const MARGIN = 40;
const LONGEST_TRAIL = 600;
const LOOK = 34; // length of the camera's arrow in pixels
// A view's world axes, to the right and up, and its name
const VIEWS = [
  { name: "From above", right: [0, 1], up: [2, -1], labels: ["X →", "↑ forward (−Z)"] },
  { name: "From the side", right: [2, -1], up: [1, 1], labels: ["forward (−Z) →", "↑ up (Y)"] },
];

export class RigDrawing {
  element = h("div", { class: "cards" });
  #trail = [];
  #path = [];
  #views = VIEWS.map((view) => ({ ...view, drawing: s("svg", { class: "drawing", viewBox: `0 0 ${SIZE} ${SIZE}`, role: "img", "aria-label": view.name }) }));

  constructor() {
    this.element.append(...this.#views.map((view) => h("figure", { class: "card" }, h("figcaption", {}, view.name), view.drawing)));
  }

  /** Set the camera's path along a move, as joints frame by frame. */
  showPath(rig, frames) {
    this.#path = frames.map((joints) => pose(rig, joints).camera);
  }

  /** Forget the camera's past path. */
  clear() {
    this.#trail = [];
    this.#path = [];
  }

  draw(rig, joints) {
    const now = pose(rig, joints);
    const last = this.#trail.at(-1);
    if (!last || last.some((value, i) => value !== now.camera[i])) this.#trail.push(now.camera);
    if (this.#trail.length > LONGEST_TRAIL) this.#trail.shift();
    const fixed = [[0, 0, 0], now.column, now.joint].filter(Boolean);
    for (const view of this.#views) this.#drawView(view, now, [...fixed, now.camera, ...this.#trail, ...this.#path]);
  }

  #drawView({ right, up, labels, drawing }, now, points) {
    const flat = (point) => [point[right[0]] * right[1], point[up[0]] * up[1]];
    const all = points.map(flat);
    const [left, low] = [0, 1].map((i) => Math.min(...all.map((point) => point[i])));
    const span = Math.max(...[0, 1].map((i) => Math.max(...all.map((point) => point[i])) - [left, low][i]), 1e-6);
    const scale = (SIZE - 2 * MARGIN) / span;
    const place = (point) => {
      const [x, y] = flat(point);
      return [MARGIN + (x - left) * scale, SIZE - MARGIN - (y - low) * scale];
    };
    const line = (list, props) => s("polyline", { fill: "none", points: list.map((point) => place(point).map((value) => value.toFixed(1)).join(",")).join(" "), ...props });
    const [x, y] = place(now.camera);
    const [lookX, lookY] = flat(now.looks);
    drawing.replaceChildren(
      line(this.#path, { class: "path", stroke: "#c75a12", "stroke-dasharray": "5 4", "stroke-width": 2 }),
      line(this.#trail, { class: "trail", stroke: "#3c8f4e", "stroke-width": 2 }),
      line([now.column, now.joint, now.camera].filter(Boolean), { class: "arm", stroke: "currentColor", "stroke-width": 5, "stroke-linejoin": "round" }),
      s("line", { class: "look", x1: x, y1: y, x2: x + LOOK * lookX, y2: y - LOOK * lookY, stroke: "#2f7fb8", "stroke-width": 3 }),
      s("circle", { class: "camera", cx: x, cy: y, r: 7, fill: "#2f7fb8" }),
      s("text", { x: SIZE - 8, y: SIZE - 8, "text-anchor": "end" }, labels[0]),
      s("text", { x: 8, y: 16 }, labels[1]),
      s("text", { x: 8, y: SIZE - 8 }, `${Number((span).toPrecision(3))} units across`),
    );
  }
}
