// The rig in space and from above: where it is as solids, the preview as edges, the camera's path along the move.

import { fitCanvas, setText, withPicture } from "./dom.js";
import { rigOf } from "./rig_model.js";
import { View } from "./solids.js";

const FRAMES = 160; // of the path
const MARGIN = 20;
const FAINT = 0.35;
const COLORS = { main: "--main", text: "--text", faint: "--faint" };
const ABOVE = Math.PI / 2 - 0.001;

export class RigView {
  #desk;
  #space;
  #plan;
  #pose;
  #above;
  #view = { yaw: 0.95, pitch: 0.32 };
  #rig = null;
  #path = [];
  #marks = [];
  #reach = [];
  #fixed = [];
  #colors = null;

  /** desk: {device, work, operation, virtual, blind}; places: the page's elements. */
  constructor(desk, { space, plan, pose, above }) {
    this.#desk = desk;
    [this.#space, this.#plan, this.#pose, this.#above] = [space, plan, pose, above];
    const { work, device } = desk;
    for (const source of [work, device.axes]) source.addEventListener("change", () => this.renew());
    device.addEventListener("settings", () => this.renew());
    work.addEventListener("see", () => this.redraw());
    for (const canvas of [space, plan]) new ResizeObserver(() => this.redraw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolor());
    this.#turns();
  }

  /** The theme has changed. */
  recolor() {
    this.#colors = null;
    this.redraw();
  }

  /** The rig, the move or the limits have changed. */
  renew() {
    this.#rig = null;
    this.redraw();
  }

  redraw = withPicture(() => {
    if (!document.hidden) this.draw();
  });

  #make() {
    const { device, work, virtual } = this.#desk;
    const range = (motor) => {
      const found = work.checked.find((each) => each.motor === motor);
      return found ? [found.need.lowest, found.need.highest] : null;
    };
    this.#rig = rigOf(virtual.rig, device, range);
    this.#fixed = this.#rig.fixed();
    this.#reach = this.#fixed.flatMap(({ corners }) => corners);
    this.#path = [];
    this.#marks = [];
    const { move } = work;
    if (!move) return;
    const at = (frame) => (motor) => work.at(motor, frame) ?? device.state.positions[motor - 1];
    const count = Math.min(FRAMES, move.endFrame - move.startFrame);
    for (let i = 0; i <= count; i += 1) {
      const stepsOf = at(move.startFrame + ((move.endFrame - move.startFrame) * i) / (count || 1));
      if (this.#rig.camera) this.#path.push(this.#rig.camera(stepsOf));
      if (i % 8 === 0) this.#reach.push(...this.#room(stepsOf));
    }
    if (this.#rig.camera && work.editable) this.#marks = work.keys.all.map(({ frame }) => this.#rig.camera(at(frame)));
  }

  /** Points that a pose takes up. */
  #room(stepsOf) {
    return [...this.#rig.moving(stepsOf).flatMap(({ corners }) => corners), ...(this.#rig.sight?.(stepsOf) ?? [])];
  }

  #color(name) {
    this.#colors ??= Object.fromEntries(Object.entries(COLORS).map(([key, variable]) => {
      const probe = document.createElement("i");
      probe.style.color = `var(${variable})`;
      this.#pose.append(probe);
      const found = getComputedStyle(probe).color;
      probe.remove();
      return [key, found];
    }));
    return this.#colors[name];
  }

  draw() {
    if (!this.#rig) this.#make();
    const { device, work, operation, blind } = this.#desk;
    const { positions } = device.state;
    const now = positions.length ? (motor) => positions[motor - 1] : null;
    const preview = work.move && !operation.playing ? (motor) => work.at(motor, work.see) ?? positions[motor - 1] : null;
    const lost = device.lost.length > 0;
    const faint = blind || lost;
    const same = now && preview && work.move.motors.every((motor) => Math.abs((now(motor) ?? 0) - preview(motor)) < 2);
    const reach = [...this.#reach, ...(now ? this.#room(now) : [])];
    const drawn = { now, preview: same ? null : preview, faint, reach: reach.length ? reach : [[0, 0, 0], [1, 1, 1]] };
    this.#paint(this.#space, this.#view, drawn);
    const [dx, dz] = [0, 2].map((i) => Math.max(...drawn.reach.map((point) => point[i])) - Math.min(...drawn.reach.map((point) => point[i])));
    const turned = dz > dx;
    this.#paint(this.#plan, { yaw: turned ? Math.PI / 2 : 0, pitch: ABOVE }, drawn);
    setText(this.#above, this.#rig.camera ? `from above, ${turned ? "forward →" : "forward ↑"}` : "from above");
    this.#say(now, faint, lost);
  }

  #say(now, faint, lost) {
    if (!this.#rig.camera || !now) {
      setText(this.#pose, now ? "A track for each motor: names in Set up, or virtual axes, show the rig." : "");
      return;
    }
    if (faint) {
      setText(this.#pose, lost ? "Camera: not known until the positions are set" : "Camera: not known");
      return;
    }
    const { camera, pan, tilt } = this.#rig.pose(now);
    setText(this.#pose, `Camera X ${camera[0].toFixed(0)} Y ${camera[1].toFixed(0)} Z ${camera[2].toFixed(0)} pan ${pan.toFixed(1)}° tilt ${tilt.toFixed(1)}°`);
  }

  #paint(canvas, angles, { now, preview, faint, reach }) {
    const place = fitCanvas(canvas);
    if (!place) return;
    const { context, width, height } = place;
    const view = new View(angles, reach, width, height, MARGIN);
    view.fill(context, this.#fixed);
    if (this.#path.length) {
      view.line(context, this.#path);
      context.strokeStyle = this.#color("main");
      context.lineWidth = 2;
      context.stroke();
    }
    context.fillStyle = this.#color("text");
    for (const [x, y] of this.#marks.map((point) => view.place(point))) {
      context.beginPath();
      for (const [dx, dy] of [[0, -5], [5, 0], [0, 5], [-5, 0]]) context.lineTo(x + dx, y + dy);
      context.fill();
    }
    if (now) {
      context.globalAlpha = faint ? FAINT : 1;
      view.fill(context, this.#rig.moving(now));
      this.#sight(context, view, now, this.#color("faint"));
      context.globalAlpha = 1;
    }
    if (!preview) return;
    context.strokeStyle = this.#color("main");
    context.setLineDash([4, 3]);
    context.lineWidth = 1.3;
    view.edges(context, this.#rig.moving(preview));
    this.#sight(context, view, preview, this.#color("main"));
    context.setLineDash([]);
  }

  #sight(context, view, stepsOf, color) {
    if (!this.#rig.sight) return;
    const [eye, ...corners] = this.#rig.sight(stepsOf);
    context.strokeStyle = color;
    context.lineWidth = 1;
    for (const corner of corners) {
      view.line(context, [eye, corner]);
      context.stroke();
    }
    view.line(context, corners);
    context.closePath();
    context.stroke();
  }

  /** Turn the view with a pointer. */
  #turns() {
    let from = null;
    const canvas = this.#space;
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, this.#view.yaw, this.#view.pitch];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.#view.yaw = from[2] - (event.clientX - from[0]) / 200;
      this.#view.pitch = Math.min(Math.max(from[3] + (event.clientY - from[1]) / 200, 0), 1.5);
      this.redraw();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { from = null; });
  }
}
