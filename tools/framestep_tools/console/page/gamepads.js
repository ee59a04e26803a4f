// A game controller: hold L1 or R1, the dead man's button, and push the left stick sideways to jog the chosen motor. The
// cross chooses a motor, B stops everything. Buttons and sticks as in the browsers' "standard" layout.

const ENABLE = [4, 5];
const STOP = 1;
const CHOOSE = [[12, -1], [13, 1]];
const STICK = 0;
const BEGINS = 0.5; // of the stick's travel
const ENDS = 0.3;

export class Gamepads {
  #calls;
  #direction = 0; // of the jog: -1, 0, 1
  #blocked = false; // the stick has to go through its middle first: it has turned, or no jog was possible
  #pressed = new Set();
  #looking = false;

  /** calls: active(): whether jogs are possible now; begin(up), end(), choose(by), stop(). */
  constructor(calls) {
    this.#calls = calls;
    window.addEventListener("gamepadconnected", () => this.#look());
  }

  #look() {
    if (this.#looking) return;
    this.#looking = true;
    const turn = () => {
      const pad = [...navigator.getGamepads()].find((each) => each?.connected);
      this.#buttons(pad);
      this.#stick(pad);
      if (pad) requestAnimationFrame(turn);
      else this.#looking = false;
    };
    turn();
  }

  /** Act once for each press. */
  #buttons(pad) {
    const acts = [[STOP, () => this.#calls.stop()], ...CHOOSE.map(([button, by]) => [button, () => this.#calls.active() && this.#calls.choose(by)])];
    for (const [button, act] of acts) {
      const down = pad?.buttons[button]?.pressed ?? false;
      if (down && !this.#pressed.has(button)) act();
      if (down) this.#pressed.add(button);
      else this.#pressed.delete(button);
    }
  }

  #stick(pad) {
    const enabled = ENABLE.some((button) => pad?.buttons[button]?.pressed);
    const way = pad?.axes[STICK] ?? 0;
    const enough = Math.abs(way) >= (this.#direction ? ENDS : BEGINS);
    const direction = enabled && enough ? Math.sign(way) : 0;
    const active = this.#calls.active();
    if (this.#blocked) {
      this.#blocked = direction !== 0;
      return;
    }
    if (active && direction === this.#direction) return; // a jog that something else has ended begins again only after a release
    if (this.#direction) this.#calls.end();
    this.#blocked = direction !== 0 && (!active || this.#direction !== 0);
    this.#direction = this.#blocked ? 0 : direction;
    if (this.#direction) this.#calls.begin(direction > 0);
  }
}
