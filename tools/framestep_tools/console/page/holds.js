// Motion that lasts as long as a button or a key is held, and not a moment longer: the dead-man behind
// every jog. A hold repeats its request; the device ends a jog that is not repeated.

const REPEAT_MS = 150; // the device waits 500 ms by default

/** All holds of the page. `end` of a hold sends what stops it. */
export class Holds {
  #holds = new Map(); // key -> {end, timer}

  constructor() {
    const release = () => this.releaseAll();
    window.addEventListener("blur", release);
    window.addEventListener("pagehide", release);
    document.addEventListener("visibilitychange", () => document.hidden && release());
    document.addEventListener("freeze", release);
  }

  /** Begin a hold, if this key has none: `repeat` is called now and again and again until the hold ends, or until it
   * gives false (what it has begun goes on by itself until `end`); when it fails the hold ends, too. `end` is called
   * once. */
  begin(key, repeat, end) {
    if (this.#holds.has(key)) return;
    const hold = { end, timer: 0 };
    this.#holds.set(key, hold);
    const turn = async () => {
      try {
        if ((await repeat()) === false) return;
      } catch {
        this.release(key);
        return;
      }
      // The next one only after an answer: a slow link must not pile up jogs behind a stop
      if (this.#holds.get(key) === hold) hold.timer = setTimeout(turn, REPEAT_MS);
    };
    turn();
  }

  /** End a hold. */
  release(key) {
    const hold = this.#holds.get(key);
    if (!hold) return;
    this.#holds.delete(key);
    clearTimeout(hold.timer);
    hold.end();
  }

  /** End every hold; what is still pressed has to be pressed again. */
  releaseAll() {
    for (const key of [...this.#holds.keys()]) this.release(key);
  }

  /** Let a button hold: pressed by pointer, space or enter. */
  button(element, key, repeat, end) {
    const begin = () => {
      if (!element.disabled) this.begin(key, repeat, end);
    };
    const release = () => this.release(key);
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      element.setPointerCapture(event.pointerId);
      begin();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
      element.addEventListener(name, release);
    }
    element.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) begin();
    });
    element.addEventListener("keyup", (event) => {
      if (event.key === " " || event.key === "Enter") release();
    });
    element.addEventListener("contextmenu", (event) => event.preventDefault()); // a long touch
    return element;
  }
}
