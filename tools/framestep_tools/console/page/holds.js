// Motion that lasts only while a button or a key is held: the dead man's switch of every jog. A hold repeats its
// request; the device ends a jog that is not repeated.

const REPEAT_MS = 150; // the device waits 500 ms by default

/** All holds of the page. `end` of a hold sends its stop. */
export class Holds {
  #holds = new Map(); // key -> {end, timer}

  constructor() {
    const release = () => this.releaseAll();
    window.addEventListener("blur", release);
    window.addEventListener("pagehide", release);
    document.addEventListener("visibilitychange", () => document.hidden && release());
    document.addEventListener("freeze", release);
  }

  /** Whether something is held. */
  get any() {
    return this.#holds.size > 0;
  }

  /** Begin a hold, if this key has none. `repeat` is called repeatedly until the hold ends, or until it returns false:
   * then the motion goes on by itself until `end`. If `repeat` fails, the hold ends too. `end` is called once. */
  begin(key, repeat, end) {
    if (this.#holds.has(key)) return;
    const hold = { end, timer: 0 };
    this.#holds.set(key, hold);
    const turn = async () => {
      const due = performance.now() + REPEAT_MS;
      try {
        if ((await repeat()) === false) return;
      } catch {
        this.release(key);
        return;
      }
      // Wait for the answer: a slow link must not queue jogs after a stop
      if (this.#holds.get(key) === hold) hold.timer = setTimeout(turn, Math.max(0, due - performance.now()));
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

  /** End every hold. Buttons that are still pressed have to be pressed again. */
  releaseAll() {
    for (const key of [...this.#holds.keys()]) this.release(key);
  }

  /** Make a button hold while it is pressed by pointer, space or enter. */
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
