// The board's rig file: read, checked, and put back with a restart.

import { M } from "./protocol.js";

const RESTART_MS = 60_000; // time for a board to restart

export class RigWork {
  #device;
  #ends;

  /** ends: returns whether getting to the REPL ends framestep, as on an ESP32. */
  constructor(device, ends = () => false) {
    this.#device = device;
    this.#ends = ends;
  }

  /** Whether the link reaches the REPL's port. */
  get possible() {
    return Boolean(this.#device.hello?.repl);
  }

  /** Return {text, there}; `{}` if the board has none. */
  async read() {
    if (!this.#ends()) return this.ask("read_rig");
    const device = this.#device;
    const { client } = device;
    await this.#mustRest();
    device.restarts = true;
    try {
      const found = await this.ask("read_rig").finally(() => this.#connectAgain(client));
      return found;
    } finally {
      device.restarts = false;
    }
  }

  /** Throw an error if a motor moves, since getting to the REPL would stop it. */
  async #mustRest() {
    if ((await this.#device.demand("MotorStatus")).motor_bits) throw new Error("motors move; nothing has been changed");
  }

  /** Return the board's greeting for a rig file. Throws an error with the mistake. */
  async check(text) {
    return (await this.ask("check_rig", { text })).text;
  }

  /** Put a rig file onto the board, which restarts, and return a sentence about it. A file with a mistake changes nothing. If
   * the board refuses the settings after its restart, it gets the previous file. say: called with each sentence on the way. */
  async write(text, say) {
    const device = this.#device;
    if (this.#ends()) await this.#mustRest();
    device.restarts = !device.client?.keeps; // with a server, that waits for the board
    try {
      return await this.#replace(text, say);
    } finally {
      device.restarts = false;
    }
  }

  /** Run a task on the REPL. Throws LinkError. */
  ask(task, values) {
    if (!this.#device.client) return Promise.reject(new Error("no device is connected"));
    return this.#device.client.ask(task, values);
  }

  async #replace(text, say) {
    const { client } = this.#device;
    const found = await this.ask("write_rig", { text }).catch(async (error) => {
      if (this.#ends()) await this.#connectAgain(client);
      throw error;
    });
    if (!found.restarts) {
      await this.#device.greet(); // the server has waited for the board
      return found.text;
    }
    say(found.text);
    await this.#connectAgain(client);
    if (await this.#isTaken()) return `${this.#device.state.info.name} has restarted with it.`;
    const again = this.#device.client;
    await this.ask("restore_rig", found.before);
    await this.#connectAgain(again);
    throw new Error("rig.json: the board refuses these settings together (framestep rig check says why); it has restarted with the previous file");
  }

  /** Return whether the board has accepted its rig file; it reports a mistake as a condition. */
  async #isTaken() {
    const { bits } = await this.#device.demand("GetCondition");
    return (bits & M.CONDITION_RIG_FILE_INVALID) === 0;
  }

  /** Wait for a board that restarts. */
  async #connectAgain(client) {
    const end = performance.now() + RESTART_MS;
    for (;;) {
      try {
        await this.#device.connect(await client.again());
        return;
      } catch (error) {
        if (performance.now() > end) throw new Error(`the board has restarted: connect it again (${error.message})`);
      }
    }
  }
}
