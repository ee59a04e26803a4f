// Explain a refusal in a sentence: which motor and frame, what is needed, what is set. This asks the device by framestep's
// own messages. Refusals of other devices keep the text of their code.

import { EXCEEDED, M } from "./protocol.js";

const SPEED = "raise it in the motor's settings, or all at once in the move's";
const PLAYED = new Set(["RtRunMove", "RtJogAll", "RtPositionFrame", "RtGo", "RtShootFrame", "RtShootFrame2"]);

/** Return a sentence, or null if the device does not report more. ask(request, values): sends a request. axes: names
 * and units of the motors. */
export async function explain(ask, request, values, code, axes) {
  try {
    if (code === M.ERR_MOVING) return "motors move, or a run waits for GO: wait, or press STOP";
    if (code === M.ERR_GENERAL) return await whatStops(ask);
    if (code === M.ERR_SOFT_UP || code === M.ERR_SOFT_LOW) {
      const found = values?.motor ? pastLimit(await ask("GetExceeded", { motor: values.motor }), values, code, axes) : null;
      if (found) return found;
    }
    if (PLAYED.has(request)) return beyond(await ask("GetExceeded"), values, axes);
  } catch {
    // it does not know this message, or is gone
  }
  return null;
}

async function whatStops(ask) {
  const { bits } = await ask("GetCondition");
  if (bits & M.CONDITION_RIG_FILE_INVALID) return "the rig file has a mistake: nothing moves until it is right";
  if (bits & M.CONDITION_ESTOP) return "the E-stop is held";
  if (bits & M.CONDITION_CLOCK) return "a program on the REPL changed the processor's clock: reset the board";
  if (bits & M.CONDITION_DRIVER) return "a driver does not work; the REPL says which and why";
  return null;
}

function pastLimit(set, { motor, position, destination }, code, axes) {
  const up = code === M.ERR_SOFT_UP;
  const limit = up ? set.upper : set.lower;
  if (limit === undefined) return null;
  const axis = axes.of(motor);
  return `${axis.full(position ?? destination)} is past the ${up ? "upper" : "lower"} soft limit of ${axis.name}, ${axis.full(limit)}`;
}

/** Say what the last move exceeds. */
function beyond(exceeded, values, axes) {
  const { what, motor, frame, by } = exceeded;
  const axis = axes.of(motor);
  const where = `${axis.name} at frame ${frame}`;
  const rate = values?.fps_milli ? ` at ${values.fps_milli / 1000} frames/s` : "";
  switch (what) {
    case M.EXCEEDED_NOTHING: return null;
    case M.EXCEEDED_VELOCITY:
      if (exceeded.velocity === undefined) break;
      return `${where} would need ${axis.fullRate(exceeded.velocity + by, "s")}${rate}, its velocity is ${axis.fullRate(exceeded.velocity, "s")}: ${SPEED}`;
    case M.EXCEEDED_ACCELERATION:
      if (exceeded.acceleration === undefined) break;
      return `${where} would need ${axis.fullRate(exceeded.acceleration + by, "s²")}${rate}, its acceleration is ${axis.fullRate(exceeded.acceleration, "s²")}: ${SPEED}`;
    case M.EXCEEDED_RATE: return `${by / 1000} frames/s are more than the ${exceeded.room / 1000} that the board can play`;
    case M.EXCEEDED_BOARD: return `${where} would need a change of velocity that the board cannot make: fewer steps or frames/s`;
    case M.EXCEEDED_UPPER: return `${where} would be past its upper soft limit${limited(axis, exceeded.upper, exceeded.bits & M.SET_UPPER)}`;
    case M.EXCEEDED_LOWER: return `${where} would be past its lower soft limit${limited(axis, exceeded.lower, exceeded.bits & M.SET_LOWER)}`;
    case M.EXCEEDED_PREROLL:
    case M.EXCEEDED_POSTROLL: {
      const roll = what === M.EXCEEDED_PREROLL ? "pre-roll" : "post-roll";
      if (by && exceeded.acceleration !== undefined) {
        return `in its ${roll} ${axis.name} would need ${axis.fullRate(exceeded.acceleration + by, "s²")}, its acceleration is ${axis.fullRate(exceeded.acceleration, "s²")}: give it a longer one, or raise the acceleration`;
      }
      return `in its ${roll} ${axis.name} would pass its soft limits: give it a shorter one`;
    }
    default:
  }
  const text = EXCEEDED[what];
  return text ? `at frame ${frame} of ${axis.name}, ${text.replace("%d", by)}` : null;
}

function limited(axis, value, set) {
  return value !== undefined && set ? `, ${axis.full(value)}` : "";
}
