// Keyframes: poses of the rig at some frames, and each motor's curve through them.

const LEAST_FRAME = -1_000_000;
const MOST_FRAME = 1_000_000;
const LONGEST = 100_000; // frames of a move
const LOWEST = -2147483648; // steps
const HIGHEST = 2147483647;
const MOTORS = 32;
const FORMAT = "framestep keyframes"; // the key by which a file is known
const KEYS = [FORMAT, "fps", "keyframes"];
const OF_KEYFRAME = ["frame", "to_next", "steps", "slopes"];

/** How a curve goes from a keyframe to the next, with the text for it. */
export const WAYS = {
  cubic: "smooth",
  ease: "ease out and in",
  linear: "straight",
  hold: "hold, then jump",
};

/** A file has no keyframes. The text names the keyframe, the key and what is allowed. */
export class KeyframesError extends Error {}

/**
 * Poses in the order of their frames. Each is {frame, way: from here to the next one (a key of WAYS), steps: an array per
 * motor, slopes: an array per motor, in steps per frame; null: by itself}.
 */
export class Keyframes {
  #keys = [];

  get all() {
    return this.#keys;
  }

  get motors() {
    return this.#keys[0]?.steps.length ?? 0;
  }

  at(frame) {
    return this.#keys.find((key) => key.frame === frame);
  }

  /** Set the pose at a frame; a keyframe that is already there keeps its curve and its slopes. */
  put(frame, steps) {
    const there = this.at(frame);
    if (there) there.steps = [...steps];
    else this.#keys.push({ frame, way: "cubic", steps: [...steps], slopes: steps.map(() => null) });
    this.#sort();
  }

  /** Move a keyframe to another frame. Return false if that frame has a keyframe. */
  shift(key, frame) {
    if (key.frame !== frame && this.at(frame)) return false;
    key.frame = frame;
    this.#sort();
    return true;
  }

  remove(key) {
    this.#keys = this.#keys.filter((each) => each !== key);
  }

  #sort() {
    this.#keys.sort((one, other) => one.frame - other.frame);
  }

  /** Return a motor's slope at keyframe number `at`, in steps per frame: the one that is set, or the automatic one. */
  slope(at, motor) {
    const key = this.#keys[at];
    if (key.slopes[motor] !== null) return key.slopes[motor];
    const [before, after] = [at - 1, at].map((first) => this.#mean(first, motor));
    const ways = [this.#keys[at - 1]?.way, key.way];
    // A straight line goes on without a bend. At the ends, beside a rest and where it turns, the motor comes to rest.
    if (ways[0] === "linear" && ways[1] === "cubic") return before;
    if (ways[1] === "linear" && ways[0] === "cubic" && after !== null) return after;
    if (before === null || after === null || before * after <= 0 || ways.some((way) => way === "ease" || way === "hold")) return 0;
    const frames = [key.frame - this.#keys[at - 1].frame, this.#keys[at + 1].frame - key.frame];
    const weights = [2 * frames[1] + frames[0], frames[1] + 2 * frames[0]];
    return (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after); // stays between the keyframes (Fritsch, Butland 1984)
  }

  /** Return the mean velocity from keyframe `first` to the next, steps per frame; null if there are not both. */
  #mean(first, motor) {
    const [one, other] = [this.#keys[first], this.#keys[first + 1]];
    return one && other ? (other.steps[motor] - one.steps[motor]) / (other.frame - one.frame) : null;
  }

  /** Return where a motor is at any frame, in steps and parts of one. */
  position(frame, motor) {
    const keys = this.#keys;
    let at = keys.findLastIndex((key) => key.frame <= frame);
    if (at < 0) at = 0;
    const [one, other] = [keys[at], keys[at + 1]];
    if (!other || frame <= one.frame || one.way === "hold") return one.steps[motor];
    const [from, to] = [one.steps[motor], other.steps[motor]];
    const frames = other.frame - one.frame;
    const x = (frame - one.frame) / frames;
    if (one.way === "linear") return from + (to - from) * x;
    const [start, end] = one.way === "ease" ? [0, 0] : [this.slope(at, motor), this.slope(at + 1, motor)];
    // cubic Hermite
    return from + x * x * (3 - 2 * x) * (to - from) + x * (1 - x) * ((1 - x) * start - x * end) * frames;
  }

  /** Return the move, as parseMove does. names: of the motors. Throws KeyframesError if there is none. */
  toMove(names) {
    const [first, last] = [this.#keys[0], this.#keys.at(-1)];
    if (!first || first === last) throw new KeyframesError("a move takes two keyframes or more");
    const count = last.frame - first.frame + 1;
    if (count > LONGEST) throw new KeyframesError(`expected at most ${LONGEST} frames, found ${count}`);
    const positions = first.steps.map((_, motor) => Array.from({ length: count }, (__, i) => {
      const steps = Math.round(this.position(first.frame + i, motor));
      if (steps < LOWEST || steps > HIGHEST) throw new KeyframesError(`frame ${first.frame + i}: motor ${motor + 1} leaves the range of positions`);
      return steps;
    }));
    return { startFrame: first.frame, endFrame: last.frame, motors: positions.map((_, motor) => motor + 1), names, positions, fps: null, counted: "" };
  }

  /** Return the text of a file. */
  text(fps) {
    const keys = this.#keys.map(({ frame, way, steps, slopes }) => ({ frame, to_next: way, steps, ...(slopes.some((slope) => slope !== null) ? { slopes } : {}) }));
    return `{\n "${FORMAT}": 1,\n "fps": ${fps},\n "keyframes": [\n${keys.map((key) => `  ${JSON.stringify(key)}`).join(",\n")}\n ]\n}\n`;
  }

  /** Take the keyframes in a text, and return its frames per second. Throws KeyframesError, and takes nothing. */
  read(text) {
    let found;
    try {
      found = JSON.parse(text);
    } catch (error) {
      throw new KeyframesError(`this is no JSON: ${error.message}`);
    }
    if (found === null || typeof found !== "object" || found[FORMAT] !== 1) throw new KeyframesError(`expected "${FORMAT}": 1`);
    const stray = Object.keys(found).find((key) => !KEYS.includes(key));
    if (stray !== undefined) throw new KeyframesError(`no key “${stray}”; there are ${KEYS.join(", ")}`);
    if (!(typeof found.fps === "number" && found.fps >= 0.001 && found.fps <= 1000)) throw new KeyframesError(`“fps”: expected a number from 0.001 to 1000, found ${JSON.stringify(found.fps)}`);
    if (!Array.isArray(found.keyframes)) throw new KeyframesError("“keyframes”: expected a list");
    const keys = found.keyframes.map((key, i) => checked(key, `keyframe ${i + 1}`));
    const motors = keys[0]?.steps.length;
    keys.sort((one, other) => one.frame - other.frame);
    keys.forEach((key, i) => {
      if (key.steps.length !== motors) throw new KeyframesError(`frame ${key.frame}: expected ${motors} positions as in the first keyframe, found ${key.steps.length}`);
      if (keys[i + 1]?.frame === key.frame) throw new KeyframesError(`frame ${key.frame} has two keyframes`);
    });
    this.#keys = keys;
    return found.fps;
  }
}

function checked(key, where) {
  const wrong = (name, allowed) => new KeyframesError(`${where}: “${name}”: expected ${allowed}, found ${JSON.stringify(key?.[name])}`);
  if (key === null || typeof key !== "object") throw new KeyframesError(`${where}: expected {"frame": …, "steps": […]}`);
  const stray = Object.keys(key).find((name) => !OF_KEYFRAME.includes(name));
  if (stray !== undefined) throw new KeyframesError(`${where}: no key “${stray}”; there are ${OF_KEYFRAME.join(", ")}`);
  const { frame, steps, to_next: way = "cubic", slopes = Array.isArray(steps) ? steps.map(() => null) : [] } = key;
  if (!whole(frame, LEAST_FRAME, MOST_FRAME)) throw wrong("frame", `a whole number from ${LEAST_FRAME} to ${MOST_FRAME}`);
  if (!Object.hasOwn(WAYS, way)) throw wrong("to_next", `one of ${Object.keys(WAYS).join(", ")}`);
  if (!Array.isArray(steps) || steps.length < 1 || steps.length > MOTORS || !steps.every((step) => whole(step, LOWEST, HIGHEST))) throw wrong("steps", "a whole number of 32 bits for each motor");
  if (!Array.isArray(slopes) || slopes.length !== steps.length || !slopes.every((slope) => slope === null || Number.isFinite(slope))) throw wrong("slopes", "a number or null for each motor");
  return { frame, way, steps, slopes };
}

function whole(value, least, most) {
  return Number.isInteger(value) && value >= least && value <= most;
}
