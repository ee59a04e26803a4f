// The rig of the example move, moved by the pulses on the pins: a camera on an arm, on a carriage.

import { h, setText } from "framestep-console/dom.js";
import { pose } from "framestep-console/kinematics.js";
import { M } from "framestep-console/protocol.js";
import { beam, draw } from "./solids.js";

const AXES = [["track", 25, "mm"], ["boom", 800, "°"], ["swing", 200, "°"], ["pan", 400, "°"]]; // motor by motor: steps per unit
const ARM = 800; // mm
const RIG = { type: M.VIRT_BOOM_SWING_TRACK, length: ARM, extension: 0, nodal: [0, 0, 0] };
const BEHIND = 0.35; // part of the arm behind its column, with the counterweight
const FLOOR = -650; // below the arm's hinge
const TIE = 200; // mm from one tie of the track to the next
const SEEN = 1700; // visible mm of the track to each side
const FREE = 500; // mm that the carriage may leave the middle before the picture follows
const MIDDLE = 950; // middle of the track
const HIGH = 0.5; // height as a part of the width
const WIDE = 3000; // visible width in mm
const METAL = [141, 153, 166];
const DARK = [77, 86, 97];
const CAMERA = [47, 127, 184];
const ARM_COLOR = [201, 138, 43];

export class RigPicture {
  #pins;
  #canvas = h("canvas", { class: "rig", role: "img", "aria-label": "The rig" });
  #said = h("p", { class: "faint" });
  #middle = MIDDLE;

  /** controls: elements in the corner. */
  constructor(pins, ...controls) {
    this.#pins = pins;
    this.element = h("article", { class: "card rig-card", "aria-label": "Rig" },
      h("h2", {}, "Rig"), ...controls, this.#canvas, this.#said);
  }

  draw() {
    const at = Object.fromEntries(AXES.map(([name, perUnit], i) => [name, (this.#pins.steps[i] ?? 0) / perUnit]));
    setText(this.#said, `Drawn from the pulses on the pins since power-up: ${AXES.map(([name, , unit], i) => `motor ${i + 1} ${name} ${at[name].toFixed(1)} ${unit}`).join(", ")}`);
    this.#middle = Math.min(Math.max(this.#middle, at.track - FREE), at.track + FREE);
    const width = this.#canvas.clientWidth;
    const height = width * HIGH;
    const scale = devicePixelRatio;
    this.#canvas.width = Math.round(width * scale);
    this.#canvas.height = Math.round(height * scale);
    const context = this.#canvas.getContext("2d");
    context.scale(scale, scale);
    // here the track runs along +X, and the arm at rest points to the front
    const view = { yaw: -0.45, pitch: 0.35, scale: width / WIDE, center: [this.#middle, -150, 300], middle: [width / 2, height / 2] };
    draw(context, this.#track(), view);
    draw(context, this.#rig(at), view);
  }

  #track() {
    const first = Math.ceil((this.#middle - SEEN) / TIE) * TIE;
    const ties = [];
    for (let x = first; x < this.#middle + SEEN; x += TIE) ties.push(beam([x, FLOOR - 20, -220], [x, FLOOR - 20, 220], 20, 40, DARK));
    return [...ties, ...[-160, 160].map((z) => beam([this.#middle - SEEN, FLOOR, z], [this.#middle + SEEN, FLOOR, z], 25, 25, METAL))];
  }

  #rig({ track, boom, swing, pan }) {
    const { camera, looks } = pose(RIG, [boom, swing, 0, pan]);
    // from the console's world, where the track runs along Z and the arm along −Z
    const turned = ([x, y, z]) => [-x, y, -z];
    const hinge = [track, 0, 0];
    const end = turned(camera).map((value, i) => value + hinge[i]);
    const back = hinge.map((value, i) => value - BEHIND * (end[i] - value));
    const ahead = turned(looks);
    const from = (distance, down = 0) => end.map((value, i) => value + distance * ahead[i] - (i === 1 ? down : 0));
    return [
      beam([track - 180, FLOOR + 50, 0], [track + 180, FLOOR + 50, 0], 70, 380, DARK),
      beam([track, FLOOR + 85, 0], [track, -20, 0], 90, 90, METAL, [0, 0, 1]),
      beam(back, end, 60, 45, ARM_COLOR),
      beam(back, back.map((value, i) => value + 0.25 * (hinge[i] - value)), 150, 150, DARK),
      beam(end, from(0, 60), 40, 40, METAL, [0, 0, 1]),
      beam(from(-90, 130), from(90, 130), 120, 90, CAMERA),
      beam(from(90, 130), from(190, 130), 75, 75, DARK),
    ];
  }
}
