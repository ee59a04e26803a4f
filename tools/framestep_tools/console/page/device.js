// What the page knows of the device, kept up to date by asking and by listening.

import { Client, LinkError, Refused } from "./client.js";
import { CONDITIONS, M, REQUESTS, TRUST } from "./protocol.js";
import { explain } from "./refusals.js";

const NO_MOTOR = 255;
const MOVING_MS = 120; // from one question what moves to the next
const RESTING_MS = 400;
const SLOW_MS = 1200; // what hardly changes

const STOPS = {
  [M.HARD_STOP_GENERAL]: () => "The E-stop was pressed.",
  [M.HARD_STOP_UPPER]: (motor) => `Motor ${motor} ran into its upper limit switch.`,
  [M.HARD_STOP_LOWER]: (motor) => `Motor ${motor} ran into its lower limit switch.`,
  [M.HARD_STOP_FAULT]: () => "A fault in the firmware or a driver has stopped the motors; the REPL tells more.",
};

const NOTHING = {
  info: null,
  positions: [],
  moving: 0,
  /** Whether the device has said what moves. */
  movingKnown: false,
  lightsMove: false,
  playHead: 0,
  trust: [],
  conditions: 0,
  inputs: 0,
  virtual: null,
};

/** Events: "change" whenever something is new, "told" {text, bad} for the user, "hardstop", "ended" after RT_END,
 * "stopped" with the reason when somebody else has stopped motors, "connected", "gone". */
export class Device extends EventTarget {
  client = null;
  hello = null;
  state = structuredClone(NOTHING);
  /** The link is there, but nothing has come in time. */
  silent = false;
  /** Whether the board restarts because the page has asked for it: it is connected again by who asked. */
  restarts = false;
  /** Whether motors can be homed: framestep with a rig file that says how. */
  homes = false;
  #timer = 0;
  #asking = false;
  #slowAt = 0;
  #unknown = new Set(); // requests that this device does not know

  get connected() {
    return this.state.info !== null;
  }

  get motors() {
    return this.state.info?.motors ?? 0;
  }

  /** Whether what the page shows of motion is what the device says now. */
  get knowsWhatMoves() {
    return this.connected && !this.silent && this.state.movingKnown;
  }

  moves(motor) {
    return ((this.state.moving >>> (motor - 1)) & 1) === 1;
  }

  /** Whether the device says in HI that it can do this. */
  can(capability) {
    return ((this.state.info?.capabilities ?? 0) & capability) !== 0;
  }

  /** Take a link that is open; resolves once the device has said who it is. */
  async connect({ link, hello }) {
    this.hello = hello;
    link.onstopped = (why) => this.dispatchEvent(new CustomEvent("stopped", { detail: why }));
    this.#unknown.clear();
    const client = new Client(link, (report) => this.#hear(report), (why) => this.#gone(client, why));
    this.client = client;
    this.state = structuredClone(NOTHING);
    this.silent = false;
    try {
      this.state.info = await client.request("Hi");
      this.homes = await this.#askWhetherItHomes(client);
    } catch (error) {
      client.close();
      throw error;
    }
    this.dispatchEvent(new Event("connected"));
    this.#slowAt = 0;
    this.#poll();
  }

  /** Ask anew who the device is: it has restarted. */
  async greet() {
    const info = await this.demand("Hi");
    this.homes = await this.#askWhetherItHomes(this.client);
    this.state = { ...structuredClone(NOTHING), info };
    this.dispatchEvent(new Event("connected"));
    this.#slowAt = 0;
    this.#soon();
  }

  /** Send a request for the user; a refusal is told and gives null, so does a link that has gone. */
  async ask(request, values) {
    try {
      return await this.demand(request, values);
    } catch (error) {
      this.tell(error.message, true);
      return null;
    }
  }

  /** The same for those who tell the user themselves: throws Refused, LinkError, RangeError. */
  async demand(request, values) {
    const { client } = this;
    if (!client) throw new LinkError("no device is connected");
    try {
      const answer = await client.request(request, values);
      this.#soon();
      return answer;
    } catch (error) {
      if (error instanceof Refused) {
        error.because(await explain((...asked) => client.request(...asked), request, values, error.code));
      }
      throw error;
    }
  }

  /** Ask at once what moves, so that `state.moving` is not older than the request before. */
  async seeWhatMoves() {
    const status = await this.demand("MotorStatus").catch(() => null);
    if (status) this.#moving(status);
  }

  /** Put a sentence before the user. */
  tell(text, bad = false) {
    this.dispatchEvent(new CustomEvent("told", { detail: { text, bad } }));
  }

  /** How far a motor's position can be trusted: {state, text}; null where the device does not tell. */
  trustOf(motor) {
    const found = this.state.trust[motor - 1];
    if (!found) return null;
    const state = TRUST.states[found.state] ?? `state ${found.state}`;
    return { state, text: `${state}: ${TRUST.reasons[found.reason] ?? `reason ${found.reason}`}` };
  }

  /** A sentence for each condition of the board. */
  conditionTexts() {
    return Object.entries(CONDITIONS).filter(([bit]) => this.state.conditions & bit).map(([, text]) => text);
  }

  /** A motor that there is not is refused in another way where there are others to home; nothing moves. */
  async #askWhetherItHomes(client) {
    if (!REQUESTS.Home) return false;
    try {
      await client.request("Home", { motors: [NO_MOTOR] });
      return true;
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      return error.code !== M.ERR_UNSUPPORTED;
    }
  }

  #gone(client, why) {
    if (this.client !== client) return;
    clearTimeout(this.#timer);
    this.client = null;
    const known = this.connected;
    this.state = structuredClone(NOTHING);
    this.dispatchEvent(new CustomEvent("gone", { detail: { why, known } }));
    this.#changed();
  }

  #hear(report) {
    const { state } = this;
    switch (report.kind) {
      case "Positions": this.#positions(report); break;
      case "InputLevels": state.inputs = report.levels; break;
      case "VirtPositions": state.virtual = report; break;
      case "HardStop":
        this.dispatchEvent(new CustomEvent("hardstop", { detail: report }));
        this.tell((STOPS[report.reason] ?? (() => `The device has stopped, reason ${report.reason}.`))(report.motor), true);
        this.#slowAt = 0;
        this.#soon();
        break;
      case "RtEnd": this.dispatchEvent(new Event("ended")); break;
      case "DeviceInfo": state.info = report; break;
      default: return;
    }
    this.#changed();
  }

  #moving(status) {
    this.state.moving = status.motor_bits;
    this.state.lightsMove = status.dmx !== 0;
    this.state.movingKnown = true;
  }

  #positions(report) {
    this.state.positions = report.steps.slice(0, this.motors);
    this.state.playHead = report.move_time;
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }

  /** Ask what moves before it would be due. */
  #soon() {
    if (this.#asking || !this.connected) return;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#poll(), 30);
  }

  async #poll() {
    clearTimeout(this.#timer);
    const { client } = this;
    if (!client || this.#asking) return;
    this.#asking = true;
    try {
      await this.#look(client);
      this.silent = false;
    } catch (error) {
      if (!(error instanceof LinkError)) throw error;
      this.silent = true;
    } finally {
      this.#asking = false;
    }
    if (this.client !== client) return;
    this.#changed();
    this.#timer = setTimeout(() => this.#poll(), this.state.moving || this.state.lightsMove ? MOVING_MS : RESTING_MS);
  }

  async #look(client) {
    const { state } = this;
    const moved = state.moving;
    const status = await client.request("MotorStatus");
    this.#moving(status);
    const now = performance.now();
    if (!state.moving && (moved || now - this.#slowAt >= SLOW_MS)) {
      this.#slowAt = now;
      this.#positions(await client.request("MotorGetPosition"));
      await this.#lookSlowly(client);
    }
  }

  async #lookSlowly(client) {
    const { state } = this;
    const condition = await this.#mayAsk(client, "GetCondition");
    if (condition) {
      state.conditions = condition.bits;
      state.trust = condition.positions;
    }
    if (state.info?.inputs) state.inputs = (await this.#mayAsk(client, "GioIn"))?.levels ?? state.inputs;
    if (this.can(M.CAP_VIRTUALS)) {
      state.virtual = await this.#mayAsk(client, "VirtGetPosition");
    }
  }

  /** Ask what not every device knows; null where it is refused, and then not again if it is unknown. */
  async #mayAsk(client, request) {
    if (this.#unknown.has(request)) return null;
    try {
      return await client.request(request);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      if (error.code === M.ERR_UNSUPPORTED) this.#unknown.add(request);
      return null;
    }
  }
}
