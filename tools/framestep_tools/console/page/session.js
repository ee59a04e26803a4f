// What a page has of its device: the link, who has the device, STOP, the state of the whole. Drawn by `frame.js` or the desk.

import { FAULTS } from "./cures.js";
import { Device } from "./device.js";
import { check, h } from "./dom.js";
import { Holds } from "./holds.js";
import { SerialLink } from "./serial_link.js";
import { M } from "./protocol.js";

const AGAIN_MS = 1000; // from the end of a link to the next try

export const device = new Device();
export const holds = new Holds();

/** Events: "change". */
class Session extends EventTarget {
  /** Why the device is gone. */
  lost = "";
  /** Why there is no link, in the server's words. */
  why = "";
  /** Another page has the device. */
  elsewhere = false;
  /** Whether a server or another source opens the link by itself. */
  automatic = false;
  /** Called at each STOP. */
  onstop = () => {};
  /** Returns whether something goes on while nothing moves, so that a hidden page has to stop it. */
  goesOn = () => false;
  #open = null; // returns {link, hello}; null if the user connects by hand
  #stopElsewhere = null; // stops everything while this page does not have the device
  #tries = true;
  #takes = false; // take the device from another page with the next try
  #watches = false; // watch the other page's device with the next try
  #keep = h("input", { onchange: () => device.client?.keep(this.#keep.checked) });
  /** A check box: whether runs go on without the page. */
  keepLine = check("Runs and moves go on when this page is hidden or closed", this.#keep);

  constructor() {
    super();
    this.keepLine.hidden = true; // until a link can keep them going
    device.addEventListener("connected", () => {
      this.lost = "";
      this.elsewhere = device.watched;
      this.#keep.checked = device.hello.kept;
      this.keepLine.hidden = !device.client.keeps || this.elsewhere;
      this.#changed();
    });
    for (const name of ["pages", "holder"]) device.addEventListener(name, () => this.#changed());
    device.addEventListener("take", () => this.takeOver());
    device.addEventListener("gone", ({ detail }) => this.#gone(detail));
    device.addEventListener("stopped", ({ detail }) => {
      holds.releaseAll();
      this.onstop();
      device.tell(detail, true);
    });
    window.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || event.repeat) return;
      event.preventDefault();
      this.stop();
    }, { capture: true });
    document.addEventListener("visibilitychange", () => document.hidden && this.#unseen());
    window.addEventListener("pagehide", () => this.#unseen());
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }

  // ---- the link

  /** Connect by `open`, and repeat if that fails. open(how): "take" takes the device from another page, "watch" watches it, else "". null: the user connects by
   * Web Serial. */
  start(open, stopElsewhere = null) {
    this.#open = open;
    this.#stopElsewhere = stopElsewhere;
    this.automatic = open !== null;
    if (open) this.#serve();
  }

  async #connect(open) {
    try {
      await device.connect(await open());
      return true;
    } catch (error) {
      device.tell(error.message, true);
      return false;
    }
  }

  /** Let the user pick a port of Web Serial, and connect to the device there. Return whether it answers. */
  byCable(baud) {
    this.#tries = false;
    device.client?.close();
    return this.#connect(() => SerialLink.open(baud));
  }

  async #serve() {
    let said = "";
    while (this.#tries) {
      const how = this.#takes ? "take" : this.#watches ? "watch" : "";
      this.#takes = this.#watches = false;
      try {
        await device.connect(await this.#open(how));
        if (this.#takes) device.client?.close(); // asked for meanwhile
        return;
      } catch (error) {
        if (error.message !== said) device.tell(error.message, true);
        said = this.why = error.message;
        this.#isElsewhere(error.held === true);
        if (this.#watches) continue;
      }
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
  }

  /** Take the device from the other page. */
  takeOver() {
    this.#takes = true;
    if (this.elsewhere) device.client?.close();
  }

  /** Who has the device while this page watches: "another page", "a phone". */
  get holder() {
    return (device.watched && device.hello.holder) || (device.watched ? "no page" : "another page");
  }

  #isElsewhere(on) {
    this.elsewhere = this.#watches = on;
    if (on) this.lost = "";
    this.#changed();
  }

  #gone({ why, known, held, said }) {
    holds.releaseAll();
    this.#changed();
    if (!known) return;
    const soon = this.elsewhere && (said || this.#takes); // this page has only watched
    this.why = why;
    if (!soon && !held) this.lost = "The link to the device has ended.";
    this.#isElsewhere(held);
    if (held) device.tell(`${why[0].toUpperCase()}${why.slice(1)}.`, true);
    else if (!soon) device.tell(`The link has ended: ${why}.`, true);
    if (this.#open && this.#tries && !device.restarts) setTimeout(() => this.#serve(), soon || held ? 0 : AGAIN_MS);
  }

  // ---- stop, and motion without this page

  /** Whether STOP reaches a device. */
  get canStop() {
    return device.connected || this.#stopElsewhere !== null;
  }

  async stop() {
    holds.releaseAll();
    this.onstop();
    if ((device.client && !this.elsewhere) || !this.#stopElsewhere) {
      device.ask("MotorStopAll");
      return;
    }
    const { stop: text, bad } = await this.#stopElsewhere();
    device.tell(text, bad);
  }

  /** The page is hidden: holds have ended by themselves; stop everything else. */
  #unseen() {
    if (device.client && !this.elsewhere && (device.state.moving || this.goesOn()) && !this.#keep.checked) this.stop();
  }

  // ---- the state of the whole

  /** Say what moves. */
  get motion() {
    if (this.elsewhere && !device.connected) return "Another page has the device and shows what moves.";
    if (!device.connected) return "Nothing is connected.";
    if (!device.knowsWhatMoves) return "What moves is not known.";
    const moving = [];
    for (let motor = 1; motor <= device.motors; motor += 1) if (device.moves(motor)) moving.push(motor);
    const what = moving.length ? `${device.axes.titles(moving)} ${moving.length > 1 ? "move" : "moves"}` : "Nothing moves";
    return `${what}${device.state.lightsMove ? ", lights fade" : ""}.`;
  }

  /** The motion with the play head. */
  get moving() {
    return this.motion + (device.knowsWhatMoves ? ` Play head ${(device.state.playHead / 1000).toFixed(3)}` : "");
  }

  /** Why it is not known whether motors move; "" if it is. */
  get blind() {
    return device.connected && device.silent ? "The device does not answer." : this.lost;
  }

  /** Bits of the faults that the board reports. */
  get faultBits() {
    return FAULTS.filter((bit) => device.state.conditions & bit);
  }

  /** Texts of the faults that the board reports. */
  get faults() {
    return device.conditionTexts(this.faultBits);
  }

  get estop() {
    return (device.state.conditions & M.CONDITION_ESTOP) !== 0;
  }
}

export const session = new Session();
