// What a move needs of each motor, next to what is set: from the differences between its frames. The board has the last
// word; this shows beforehand what does not fit, and where.

import { M } from "./protocol.js";

/** Return the greatest velocity and acceleration of each motor between frames, and where they are:
 * [{velocity, velocityAt, acceleration, accelerationAt, lowest, lowestAt, highest, highestAt}], in steps and frames. */
export function needs(move, fps) {
  return move.positions.map((steps) => {
    const found = { velocity: 0, velocityAt: 0, acceleration: 0, accelerationAt: 0, lowest: steps[0], lowestAt: 0, highest: steps[0], highestAt: 0 };
    let before = 0;
    for (let at = 1; at < steps.length; at += 1) {
      const change = steps[at] - steps[at - 1];
      if (Math.abs(change) > found.velocity) [found.velocity, found.velocityAt] = [Math.abs(change), at];
      if (at > 1 && Math.abs(change - before) > found.acceleration) [found.acceleration, found.accelerationAt] = [Math.abs(change - before), at];
      before = change;
      if (steps[at] < found.lowest) [found.lowest, found.lowestAt] = [steps[at], at];
      if (steps[at] > found.highest) [found.highest, found.highestAt] = [steps[at], at];
    }
    for (const name of ["velocityAt", "accelerationAt", "lowestAt", "highestAt"]) found[name] += move.startFrame;
    found.velocity = Math.ceil(found.velocity * fps);
    found.acceleration = Math.ceil(found.acceleration * fps * fps);
    return found;
  });
}

/** Return what of a motor's need does not fit, [{what, at, text}], or [] if everything does. set: as the device reports it, or null. */
export function misfits(need, set, axis) {
  const found = [];
  if (set && need.velocity > set.velocity) found.push({ what: "velocity", at: need.velocityAt, text: `needs ${axis.withUnit(axis.short(axis.rate(need.velocity)), "/s")}, set ${axis.withUnit(axis.short(axis.rate(set.velocity)), "/s")}` });
  if (set && need.acceleration > set.acceleration) found.push({ what: "acceleration", at: need.accelerationAt, text: `needs ${axis.withUnit(axis.short(axis.rate(need.acceleration)), "/s²")}, set ${axis.withUnit(axis.short(axis.rate(set.acceleration)), "/s²")}` });
  const [low, high] = [limit(set, "lower", M.SET_LOWER) ?? axis.limits?.[0], limit(set, "upper", M.SET_UPPER) ?? axis.limits?.[1]];
  const past = (end, steps, at) => found.push({ what: "limit", at, text: `goes to ${axis.withUnit(axis.short(axis.position(steps)))}, past its limit of ${axis.withUnit(axis.short(axis.position(end)))}` });
  if (low !== undefined && need.lowest < low) past(low, need.lowest, need.lowestAt);
  if (high !== undefined && need.highest > high) past(high, need.highest, need.highestAt);
  return found;
}

function limit(set, end, bit) {
  return set && set.bits & bit ? set[end] : undefined;
}
