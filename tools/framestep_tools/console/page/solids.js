// Beams in space, drawn in parallel projection, the farthest face first; or their edges alone.

const FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
const DARKEST = 0.45; // part of a color away from the light
const LIGHT = normal([-0.4, 1, 0.6]);

export const add = (a, b, factor = 1) => a.map((value, i) => value + factor * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

export function normal(vector) {
  const length = Math.hypot(...vector) || 1;
  return vector.map((value) => value / length);
}

/** A beam between two points; `up`: direction of the height of its cross-section, high × wide. color: [red, green, blue]. */
export function beam(from, to, high, wide, color, up = [0, 1, 0]) {
  const along = normal(add(to, from, -1));
  const side = normal(cross(along, Math.abs(dot(along, up)) > 0.99 ? [1, 0, 0] : up));
  const top = cross(side, along);
  const corners = [from, to].flatMap((end) => [-0.5, 0.5].flatMap((v) => [-0.5, 0.5].map((w) => add(add(end, top, v * high), side, w * wide))));
  return { corners, color };
}

/** A view of space on a canvas of w × h pixels that shows all of these points. */
export class View {
  #right;
  #up;
  #eye;
  #scale;
  #middle;
  #center;

  constructor({ yaw, pitch }, points, w, h, margin) {
    this.#right = [Math.cos(yaw), 0, -Math.sin(yaw)];
    this.#eye = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
    this.#up = cross(this.#eye, this.#right);
    const [us, vs] = [this.#right, this.#up].map((axis) => points.map((point) => dot(point, axis)));
    const [u0, u1, v0, v1] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
    this.#scale = Math.max(Math.min((w - 2 * margin) / (u1 - u0 || 1), (h - 2 * margin) / (v1 - v0 || 1)), 1e-9);
    this.#center = [(u0 + u1) / 2, (v0 + v1) / 2];
    this.#middle = [w / 2, h / 2];
  }

  /** Return a point's place on the canvas. */
  place(point) {
    return [this.#middle[0] + this.#scale * (dot(point, this.#right) - this.#center[0]), this.#middle[1] - this.#scale * (dot(point, this.#up) - this.#center[1])];
  }

  line(context, points) {
    context.beginPath();
    for (const point of points) context.lineTo(...this.place(point));
  }

  /** Draw beams as solids. */
  fill(context, beams) {
    const faces = beams.flatMap(({ corners, color }) => FACES.map((indices) => {
      const points = indices.map((i) => corners[i]);
      const outward = normal(cross(add(points[1], points[0], -1), add(points[2], points[0], -1)));
      return { points, color, depth: points.reduce((sum, point) => sum + dot(point, this.#eye), 0), light: Math.abs(dot(outward, LIGHT)) };
    })).sort((a, b) => a.depth - b.depth);
    for (const { points, color, light } of faces) {
      this.line(context, points);
      context.closePath();
      context.fillStyle = `rgb(${color.map((part) => Math.round(part * (DARKEST + (1 - DARKEST) * light))).join(" ")})`;
      context.fill();
    }
  }

  /** Draw the edges of beams. */
  edges(context, beams) {
    for (const { corners } of beams) {
      for (const indices of FACES.slice(2)) {
        this.line(context, indices.map((i) => corners[i]));
        context.closePath();
        context.stroke();
      }
    }
  }
}
