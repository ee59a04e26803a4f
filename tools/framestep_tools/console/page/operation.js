// An operation that is prepared, waits for GO and plays: a run or a shot. The page has only one, as has the device.

const NONE = "none";
const GOING = "going"; // the motors move to the start
const READY = "ready";
const PLAYING = "playing";
const LOST = "lost"; // the link has ended since GO

/** Events: "change", "stopped" when everything has been stopped, "over" when it has ended. `name`: such as "Run 1 to 240". */
export class Operation extends EventTarget {
  name = "";
  /** Whether the last one is still going on. */
  early = false;
  #device;
  #state = NONE;
  #last = null; // frame at which it ends by itself
  #loops = false; // it does not end by itself
  #stopped = false; // a stop has been requested
  #asked = false; // GO has been sent and not answered, and nothing has ended since

  constructor(device) {
    super();
    this.#device = device;
    device.addEventListener("ended", () => this.#end());
    device.addEventListener("hardstop", () => {
      this.#stopped = true;
      this.#end();
    });
    device.addEventListener("gone", () => this.#lose());
    device.addEventListener("change", () => this.#state === GOING && !device.state.moving && this.#set(READY));
  }

  get ready() {
    return this.#state === READY;
  }

  /** Whether the motors go to where it begins. */
  get going() {
    return this.#state === GOING;
  }

  /** Whether it has the motors. */
  get busy() {
    return this.#state === GOING || this.#state === PLAYING;
  }

  /** Whether it plays and does not end by itself. */
  get loops() {
    return this.playing && this.#loops;
  }

  get playing() {
    return this.#state === PLAYING;
  }

  /** Whether the link has ended since GO, so how the operation has ended is not known. */
  get lost() {
    return this.#state === LOST;
  }

  get text() {
    if (this.#state !== NONE && this.#device.connected && this.#device.silent) {
      return `${this.name}: the device does not answer, so whether it goes on is not known.`;
    }
    return {
      [NONE]: "Nothing is prepared from this page.",
      [GOING]: `${this.name}: the motors go to where it begins.`,
      [READY]: `${this.name} is ready: GO starts it.`,
      [PLAYING]: `${this.name} plays.`,
      [LOST]: `${this.name}: the link has ended since GO, so whether it goes on or has ended is not known.`,
    }[this.#state];
  }

  /**
   * Prepare the operation. False if the device refuses. last: the frame at which it ends by itself, or null if it is not known.
   * loops: it does not end by itself.
   */
  async prepare(name, request, values, { last = null, loops = false } = {}) {
    if (!(await this.#device.ask(request, values))) return false;
    this.name = name;
    this.#last = last;
    this.#loops = loops;
    this.#stopped = false;
    await this.#device.seeWhatMoves(); // the device reports motion from the answer on
    this.#set(GOING);
    return true;
  }

  /** Start the operation. */
  async go() {
    this.#asked = true;
    const taken = await this.#device.ask("RtGo");
    if (taken && this.#asked) this.#set(PLAYING); // a short one may have ended before this line
    this.#asked = false;
  }

  /** Let the lap under way be the last one of a loop. */
  async endLoop() {
    if (await this.#device.ask("RtStopLoop")) this.#loops = false;
  }

  /** Note that everything has been stopped. */
  stopped() {
    this.#stopped = true;
    if (this.#state !== PLAYING) this.#set(NONE); // a run reports its end itself
    this.dispatchEvent(new Event("stopped"));
  }

  #end() {
    if (this.#state === PLAYING || this.#asked) {
      const { playHead } = this.#device.state;
      this.early = this.#stopped || this.#loops || (this.#last !== null && playHead !== this.#last * 1000);
      this.#device.tell(this.early ? `${this.name} was stopped at frame ${(playHead / 1000).toFixed(3)}.` : `${this.name} is over.`, this.early);
      this.#asked = false;
      this.#set(NONE);
      this.dispatchEvent(new Event("over"));
      return;
    }
    this.#asked = false;
    this.#set(NONE);
  }

  #lose() {
    const begun = this.#state === PLAYING || this.#asked;
    this.#asked = false;
    this.#set(begun ? LOST : NONE);
    if (begun) this.#device.tell(this.text, true);
  }

  #set(state) {
    if (this.#state === state) return;
    this.#state = state;
    this.dispatchEvent(new Event("change"));
    this.#device.dispatchEvent(new Event("change"));
  }
}
