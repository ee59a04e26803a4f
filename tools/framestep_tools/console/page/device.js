// The page's knowledge of the device, kept up to date by requests and reports.

import { Axes } from "./axes.js";
import { Client, LinkError, Refused } from "./client.js";
import { CONDITIONS, HOMED, M, REQUESTS, TRUST } from "./protocol.js";
import { explain } from "./refusals.js";

const NO_MOTOR = 255;
const MOVING_MS = 120; // interval of the question what moves
const RESTING_MS = 400;
const SLOW_MS = 1200; // interval for values that seldom change

const STOPS = {
  [M.HARD_STOP_GENERAL]: () => "The E-stop was pressed.",
  [M.HARD_STOP_UPPER]: (name) => `${name} ran into its upper limit switch.`,
  [M.HARD_STOP_LOWER]: (name) => `${name} ran into its lower limit switch.`,
  [M.HARD_STOP_FAULT]: () => "A fault in the firmware or a driver has stopped the motors; the REPL says more.",
};

const NOTHING = {
  info: null,
  positions: [],
  moving: 0,
  /** Whether the device has reported what moves. */
  movingKnown: false,
  lightsMove: false,
  playHead: 0,
  trust: [],
  conditions: 0,
  inputs: 0,
  virtual: null,
};

/** Events: "change" for anything new, "settings" for a motor's, "message" {text, bad} for the user, "hardstop", "ended" after RT_END, "refused" with the error,
 * "stopped" with the reason when another program has stopped motors, "connected", "gone" with {why, known, held: another page has the device, said: the server has ended the link}, "pages", "holder", "take" as in WebSocketLink. */
export class Device extends EventTarget {
  client = null;
  /** Names and units of the motors. */
  axes = new Axes();
  hello = null;
  state = structuredClone(NOTHING);
  /** The link is open, but no answer has come in time. */
  silent = false;
  /** Whether the page restarts the board; the code that restarts it also connects again. */
  restarts = false;
  /** Whether motors can be homed: framestep with `home` in the rig file. */
  homes = false;
  #timer = 0;
  #asking = false;
  #slowAt = 0;
  #unknown = new Set(); // requests that this device does not know
  #settings = []; // of each motor as it reports them, or null

  /** Whether another page has the device, and this one watches. */
  get watched() {
    return this.connected && this.hello.watch === true;
  }

  get connected() {
    return this.state.info !== null;
  }

  get motors() {
    return this.state.info?.motors ?? 0;
  }

  /** Whether the motion on the page is up to date. */
  get knowsWhatMoves() {
    return this.connected && !this.silent && this.state.movingKnown;
  }

  moves(motor) {
    return ((this.state.moving >>> (motor - 1)) & 1) === 1;
  }

  /** Return the soft limits of a motor, [lowest, highest] step, or null if it has not both, or the device reports none. */
  limitsOf(motor) {
    const told = this.setOf(motor);
    const both = M.SET_LOWER | M.SET_UPPER;
    return told && (told.bits & both) === both ? [told.lower, told.upper] : null;
  }

  /** Return a motor's settings as last seen, as Exceeded has them; null if the device has not reported them. */
  setOf(motor) {
    return this.#settings[motor - 1] ?? null;
  }

  /** Return a motor's settings, as Exceeded has them; null if the device does not report them. */
  async settingsOf(motor) {
    const { client } = this;
    const reported = client && await this.#mayAsk(client, "GetExceeded", { motor }).catch(() => null);
    return reported?.velocity === undefined ? null : reported;
  }

  /** Ask for the settings of a motor. */
  async seeSettings(motor) {
    this.#settings[motor - 1] = await this.settingsOf(motor);
    this.dispatchEvent(new Event("settings"));
    this.#changed();
  }

  /** Whether HI advertises this capability. */
  can(capability) {
    return ((this.state.info?.capabilities ?? 0) & capability) !== 0;
  }

  /** Use an open link. Resolves once the device has answered HI. */
  async connect({ link, hello }) {
    this.hello = hello;
    link.onpages = () => this.dispatchEvent(new Event("pages"));
    link.onholder = (who) => {
      hello.holder = who;
      this.dispatchEvent(new Event("holder"));
    };
    link.ontake = () => this.dispatchEvent(new Event("take"));
    link.onstopped = (why) => this.dispatchEvent(new CustomEvent("stopped", { detail: why }));
    this.#unknown.clear();
    const client = new Client(link, (report) => this.#hear(report), (why, { held, said }) => this.#gone(client, { why, held, said }));
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
    this.#begin();
    this.#poll();
  }

  /** Send HI again after a restart. */
  async greet() {
    const info = await this.demand("Hi");
    this.homes = await this.#askWhetherItHomes(this.client);
    this.state = { ...structuredClone(NOTHING), info };
    this.#begin();
    this.#soon();
  }

  #begin() {
    this.dispatchEvent(new Event("connected"));
    this.#slowAt = 0;
    this.#settings = [];
    this.#seeAllSettings();
  }

  async #seeAllSettings() {
    for (let motor = 1; motor <= this.motors && !this.#unknown.has("GetExceeded"); motor += 1) await this.seeSettings(motor);
  }

  /** Send a request for the user. A refusal, or a lost link, is shown and gives null. */
  async ask(request, values) {
    try {
      return await this.demand(request, values);
    } catch (error) {
      this.tell(error.message, true);
      if (error instanceof Refused) this.dispatchEvent(new CustomEvent("refused", { detail: error }));
      return null;
    }
  }

  /** Send a request for a caller that informs the user itself. Throws Refused, LinkError, RangeError. */
  async demand(request, values) {
    const { client } = this;
    if (!client) throw new LinkError("no device is connected");
    try {
      const answer = await client.request(request, values);
      this.#soon();
      return answer;
    } catch (error) {
      if (error instanceof Refused) {
        error.motor = values?.motor;
        error.because(await explain((...asked) => client.request(...asked), request, values, error.code, this.axes));
      }
      throw error;
    }
  }

  /** Ask at once what moves, so `state.moving` is not older than the previous request. */
  async seeWhatMoves() {
    const status = await this.demand("MotorStatus").catch(() => null);
    if (status) this.#moving(status);
  }

  /** Show a sentence to the user. */
  tell(text, bad = false) {
    this.dispatchEvent(new CustomEvent("message", { detail: { text, bad } }));
  }

  /** Return how far a motor's position can be trusted, {state, text}, or null if the device does not report it. */
  trustOf(motor) {
    const found = this.state.trust[motor - 1];
    if (!found) return null;
    const state = TRUST.states[found.state] ?? `state ${found.state}`;
    return { state, text: `${state}: ${TRUST.reasons[found.reason] ?? `reason ${found.reason}`}` };
  }

  /** Motors whose position is lost. */
  get lost() {
    return this.state.trust.flatMap((_, i) => (this.trustOf(i + 1)?.state === "lost" ? [i + 1] : []));
  }

  /** Return a sentence for each condition of the board, or for some bits of it. */
  conditionTexts(bits = Object.keys(CONDITIONS)) {
    return bits.filter((bit) => this.state.conditions & bit).map((bit) => CONDITIONS[bit]);
  }

  /** Home motors (none: all that can be), and report how it has ended. */
  async home(motors) {
    if (!(await this.ask("Home", { motors }))) return;
    await this.seeWhatMoves();
    const homed = motors.length ? motors : Array.from({ length: this.motors }, (_, i) => i + 1).filter((motor) => this.moves(motor));
    const ended = () => {
      if (this.connected && (!this.knowsWhatMoves || this.state.moving)) return;
      this.removeEventListener("change", ended);
      if (!this.connected) return;
      for (const motor of homed) {
        const trust = this.trustOf(motor);
        const done = this.state.trust[motor - 1]?.reason === HOMED;
        this.tell(`${this.axes.of(motor).title} is ${done ? "homed" : `not homed: its position is ${trust?.text ?? "not known"}`}.`, !done);
      }
    };
    this.addEventListener("change", ended);
  }

  /** Find out whether motors can be homed: HOME of a missing motor moves nothing, and its refusal shows it. */
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

  #gone(client, detail) {
    if (this.client !== client) return;
    clearTimeout(this.#timer);
    this.client = null;
    const known = this.connected;
    this.state = structuredClone(NOTHING);
    this.dispatchEvent(new CustomEvent("gone", { detail: { ...detail, known } }));
    this.#changed();
  }

  #hear(report) {
    const { state } = this;
    switch (report.kind) {
      case "Positions": this.#positions(report); break;
      case "InputLevels": state.inputs = report.levels; break;
      case "VirtPositions": state.virtual = report; break;
      case "HardStop":
        report.text = (STOPS[report.reason] ?? (() => `The device has stopped, reason ${report.reason}.`))(this.axes.of(report.motor).title);
        this.dispatchEvent(new CustomEvent("hardstop", { detail: report }));
        this.tell(report.text, true);
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

  /** Ask what moves ahead of time. */
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

  /** Send a request that not every device knows. Null if it is refused; an unknown one is not sent again. */
  async #mayAsk(client, request, values) {
    if (this.#unknown.has(request)) return null;
    try {
      return await client.request(request, values);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      if (error.code === M.ERR_UNSUPPORTED) this.#unknown.add(request);
      return null;
    }
  }
}
