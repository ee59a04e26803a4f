// Frames shot one after another, each at its time: a timelapse. Between two pictures the rig goes to the next frame.

/** Events of a series come as calls of `tell`; see Operation for the page's one operation. */
export class Series {
  #device;
  #operation;
  #goesOn = false;
  /** Pictures that are taken, of how many, and when the next GO comes: {done, count, due}; due is null until it is known. */
  progress = { done: 0, count: 0, due: null };

  constructor(device, operation) {
    this.#device = device;
    this.#operation = operation;
    operation.addEventListener("stopped", () => { this.#goesOn = false; });
    device.addEventListener("hardstop", () => { this.#goesOn = false; });
    device.addEventListener("gone", () => { this.#goesOn = false; });
  }

  get goesOn() {
    return this.#goesOn;
  }

  /**
   * Shoot these frames. interval: ms from one GO to the next; if the rig needs longer, the next GO comes as soon as it is ready.
   * request(frame): the values of RtShootFrame2; done(frame): called after each shot. Resolves when all are shot or something has stopped it, and says which.
   */
  async shoot(frames, interval, request, done = () => {}) {
    if (this.#goesOn) return;
    this.#goesOn = true;
    const shot = [];
    let late = 0;
    let due = null; // of the next GO
    for (const frame of frames) {
      this.progress = { done: shot.length, count: frames.length, due };
      if (!(await this.#ready(frame, request))) break;
      const now = performance.now();
      if (due !== null && now > due) late += 1;
      due = Math.max(due ?? now, now);
      this.progress.due = due;
      await this.#until(() => performance.now() >= due, () => due - performance.now());
      if (!this.#goesOn) break;
      due += interval;
      await this.#operation.go();
      if (this.#operation.ready) break; // GO was refused
      await this.#until(() => !this.#operation.playing);
      if (!this.#goesOn || this.#operation.early) break;
      shot.push(frame);
      done(frame);
    }
    this.#goesOn = false;
    this.#device.tell(...this.#result(frames, shot, late));
  }

  #result(frames, shot, late) {
    if (shot.length < frames.length) {
      const { lost } = this.#operation;
      const doubt = lost ? `Whether frame ${frames[shot.length]} is shot is not known. ` : "";
      const done = shot.length ? `Frames ${shot[0]} to ${shot.at(-1)} are shot` : `No ${lost ? "other " : ""}frame is shot`;
      const left = frames.slice(shot.length + Number(lost));
      return [`${doubt}${done}${left.length ? `; ${left.length} are not, from frame ${left[0]} on` : ""}.`, true];
    }
    const note = late ? ` ${late} of them later than the interval says: the rig and the exposure take longer.` : "";
    return [`All ${frames.length} frames are shot.${note}`, late > 0];
  }

  /** Bring the rig to a frame and prepare its shot. Return false if it is refused or stopped. */
  async #ready(frame, request) {
    if (!(await this.#device.ask("RtPositionFrame", { frame }))) return false;
    await this.#device.seeWhatMoves();
    await this.#until(() => this.#device.knowsWhatMoves && !this.#device.state.moving);
    if (!this.#goesOn || !(await this.#operation.prepare(`The shot of frame ${frame}`, "RtShootFrame2", request(frame)))) return false;
    await this.#until(() => this.#operation.ready);
    return this.#goesOn;
  }

  /** Wait until the test holds or the series is stopped. rest(): the ms after which to look again if nothing has changed. */
  async #until(test, rest = null) {
    while (this.#goesOn && !test()) {
      await new Promise((resolve) => {
        const timer = rest ? setTimeout(resolve, Math.max(0, rest())) : 0;
        const look = () => {
          clearTimeout(timer);
          resolve();
        };
        for (const source of [this.#device, this.#operation]) source.addEventListener("change", look, { once: true });
      });
    }
  }
}
