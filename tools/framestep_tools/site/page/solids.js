// Beams in space, drawn in parallel projection, the farthest face first.

const FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
const DARKEST = 0.45; // part of a color away from the light
const LIGHT = normal([-0.4, 1, 0.6]);

const add = (a, b, factor = 1) => a.map((value, i) => value + factor * b[i]);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

function normal(vector) {
  const length = Math.hypot(...vector);
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

/** view: {yaw, pitch} in radians, scale in pixels per unit, center: the point that is at `middle` [x, y]. */
export function draw(context, beams, { yaw, pitch, scale, center, middle }) {
  const right = [Math.cos(yaw), 0, -Math.sin(yaw)];
  const toEye = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
  const up = cross(toEye, right);
  const faces = beams.flatMap(({ corners, color }) => FACES.map((indices) => {
    const points = indices.map((i) => corners[i]);
    const middleOf = points.reduce((sum, point) => add(sum, point, 0.25), [0, 0, 0]);
    const outward = normal(cross(add(points[1], points[0], -1), add(points[2], points[0], -1)));
    return { points, color, depth: dot(middleOf, toEye), light: Math.abs(dot(outward, LIGHT)) };
  })).sort((a, b) => a.depth - b.depth);
  for (const { points, color, light } of faces) {
    context.beginPath();
    for (const point of points) {
      const seen = add(point, center, -1);
      context.lineTo(middle[0] + scale * dot(seen, right), middle[1] - scale * dot(seen, up));
    }
    context.closePath();
    context.fillStyle = `rgb(${color.map((part) => Math.round(part * (DARKEST + (1 - DARKEST) * light))).join(" ")})`;
    context.fill();
  }
}
