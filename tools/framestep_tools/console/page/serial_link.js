// The link without a server: Web Serial, in Chromium and its relatives. The user picks the port.

import { BoardWork } from "./board_work.js";
import { LinkError } from "./client.js";

const NOMINAL_BAUD = 115200; // meaningless on USB, but required

export const serialIsThere = () => "serial" in navigator;

const AGAIN_MS = 300;

/** Let the user choose a port of Web Serial. Throws LinkError. */
export async function choosePort() {
  try {
    return await navigator.serial.requestPort();
  } catch {
    throw new LinkError("no port was chosen");
  }
}

export class SerialLink {
  onbytes = () => {};
  onend = () => {};
  #port;
  #writer;
  #reader;
  #ended = false;
  #closed = false;
  #work = null; // tasks on the REPL's port, once the user has chosen it

  /** Open a port that the user picks. DTR shows the device that a host is connected. */
  static async open() {
    return SerialLink.#begin(await choosePort());
  }

  static async #begin(port) {
    try {
      await port.open({ baudRate: NOMINAL_BAUD });
      await port.setSignals({ dataTerminalReady: true });
    } catch (error) {
      throw new LinkError(`the port cannot be opened (${error.message}): does another program have it?`);
    }
    return { link: new SerialLink(port), hello: { device: "the chosen port", repl: false, kept: false } };
  }

  /** Open a known port, with the REPL's. name: its name on the page. */
  static async at(port, repl, name) {
    const found = await SerialLink.#begin(port);
    found.hello.device = name;
    found.link.#work = new BoardWork(repl);
    found.hello.repl = true;
    return found;
  }

  constructor(port) {
    this.#port = port;
    this.#writer = port.writable.getWriter();
    this.#reader = port.readable.getReader();
    this.#read();
  }

  /** Let the user choose the port of the board's REPL, for `ask`. */
  async chooseRepl() {
    this.#work = new BoardWork(await choosePort());
  }

  /** Run a task on the REPL, as framestep console's server does. Throws LinkError if its port has not been chosen. */
  ask(task, values = {}) {
    if (!this.#work) return Promise.reject(new LinkError("the port of the REPL has not been chosen"));
    return this.#work[task](values);
  }

  openTerminal(terminal) {
    return this.#work.openTerminal(terminal);
  }

  type(text) {
    this.#work.type(text);
  }

  closeTerminal() {
    return this.#work.closeTerminal();
  }

  /** Open the same ports again after a restart, {link, hello}. Throws LinkError if the port is missing. */
  async again() {
    await this.close();
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    const found = await SerialLink.#begin(this.#port);
    found.link.#work = this.#work;
    found.hello.repl = found.hello.terminal = this.#work !== null;
    return found;
  }

  send(bytes) {
    this.#writer.write(bytes).catch((error) => this.#end(`the port takes nothing more: ${error.message}`));
  }

  async close() {
    if (this.#closed) return;
    this.#closed = true;
    await this.#reader.cancel().catch(() => {});
    this.#reader.releaseLock();
    this.#writer.releaseLock();
    await this.#port.close().catch(() => {});
    this.#end("the port was closed");
  }

  async #read() {
    try {
      for (;;) {
        const { value, done } = await this.#reader.read();
        if (done) break;
        this.onbytes(value);
      }
      this.#end("the port was closed");
    } catch (error) {
      this.#end(`the connection broke off (${error.message}); what moved comes to rest by itself`);
    }
  }

  #end(why) {
    if (this.#ended) return;
    this.#ended = true;
    this.onend(why);
  }
}
