// The link through `framestep console`: bytes of the protocol over a WebSocket, and the server's tasks (rig file, the
// board's load).

import { LinkError } from "./client.js";

const STOP_MS = 1000; // for which a stop is tried

export class WebSocketLink {
  onbytes = () => {};
  onend = () => {};
  /** Another program or page has stopped motors, with the reason: end all holds. */
  onstopped = () => {};
  /** Which pages watch has changed: [{number, who}]. */
  onpages = () => {};
  /** Over the link of a page that watches: who has the device has changed, null for nobody; that page hands it over. */
  onholder = () => {};
  ontake = () => {};
  pages = [];
  /** The link has ended because another page has the device. */
  held = false;
  /** The server has said why it ends. */
  said = false;
  #terminal = null; // {text, end} of the REPL's terminal
  #socket;
  #why = "framestep console does not answer, or this address has the token of an earlier start: open the address that it prints";
  #nextTask = 1;
  #tasks = new Map();

  /** Connect. Resolves with {link, hello} once the server has the device's port. */
  static open(address) {
    return new Promise((resolve, reject) => new WebSocketLink(address, resolve, reject));
  }

  /** Stop everything, whichever page or program has the device. Resolves with {stop: text, bad}. A link that is not there is tried again for a second. */
  static async stop(address) {
    const end = performance.now() + STOP_MS;
    for (;;) {
      const said = await WebSocketLink.#stopOnce(address);
      if (said) return said;
      if (performance.now() > end) break;
      await new Promise((resolve) => setTimeout(resolve, STOP_MS / 10));
    }
    return { stop: "NOT STOPPED, it could not be sent: framestep console does not answer. Press the E-stop, or switch the motors' supply off.", bad: true };
  }

  static #stopOnce(address) {
    return new Promise((resolve) => {
      const socket = new WebSocket(`${address}&stop=1`);
      socket.onmessage = ({ data }) => resolve(JSON.parse(data));
      socket.onclose = () => resolve(null);
    });
  }

  constructor(address, resolve, reject) {
    this.#socket = new WebSocket(address);
    this.#socket.binaryType = "arraybuffer";
    this.#socket.onmessage = ({ data }) => {
      if (typeof data !== "string") {
        this.onbytes(new Uint8Array(data));
        return;
      }
      const said = JSON.parse(data);
      if (said.device !== undefined) {
        this.#why = "the link to framestep console has closed";
        resolve({ link: this, hello: { terminal: said.repl, ...said } });
      }
      else if (said.ended !== undefined) {
        this.#why = said.ended;
        this.held = said.held === true;
        this.said = true;
      } else if (said.pages) {
        this.pages = said.pages;
        this.onpages();
      } else if (said.holder !== undefined) this.onholder(said.holder);
      else if (said.take) this.ontake();
      else if (said.repl !== undefined) this.#terminal?.text(said.repl);
      else if (said.repl_ended !== undefined) this.#endTerminal(said.repl_ended);
      else if (said.stopped) {
        this.onstopped(said.stopped);
        this.#socket.send(JSON.stringify({ released: true }));
      }
      else this.#answer(said);
    };
    this.#socket.onclose = () => {
      reject(new LinkError(this.#why, this.held));
      for (const { reject: fail } of this.#tasks.values()) fail(new LinkError(this.#why));
      this.#tasks.clear();
      this.#endTerminal(this.#why);
      this.onend(this.#why);
    };
  }

  send(bytes) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(bytes);
  }

  close() {
    this.#socket.close();
  }

  keep(on) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify({ keep: on }));
  }

  /** Let a page that watches take the device. */
  handOver(number) {
    this.#socket.send(JSON.stringify({ hand_over: number }));
  }

  ask(task, values = {}) {
    const id = this.#nextTask++;
    return new Promise((resolve, reject) => {
      this.#tasks.set(id, { resolve, reject });
      this.#socket.send(JSON.stringify({ ...values, id, do: task }));
    });
  }

  /** Open a terminal on the REPL's port. text: called with the output; end: once, with the reason, if it ends by itself. */
  async openTerminal(terminal) {
    this.#terminal = terminal;
    try {
      await this.ask("terminal");
    } catch (error) {
      this.#terminal = null;
      throw error;
    }
  }

  type(text) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify({ typed: text }));
  }

  async closeTerminal() {
    this.#terminal = null;
    await this.ask("close_terminal");
  }

  #endTerminal(why) {
    const terminal = this.#terminal;
    this.#terminal = null;
    terminal?.end(why);
  }

  #answer({ id, result, error }) {
    const task = this.#tasks.get(id);
    this.#tasks.delete(id);
    if (error !== undefined) task?.reject(new LinkError(error));
    else task?.resolve(result);
  }
}
