// The link without a server: Web Serial, in Chromium and its relatives. The user picks the port.

import { BoardWork } from "./board_work.js";
import { LinkError } from "./client.js";
import { USUAL_BAUD } from "./repl_port.js";
import { bareRig } from "./rig_text.js";

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
  #baud;
  #ends = false; // tasks end framestep, and the board restarts after each
  #writer;
  #reader;
  #tries = 0;
  #ended = false;
  #closed = false;
  #work = null; // tasks on the REPL's port, once the user has chosen it

  /** Open a port that the user picks. DTR shows the device that a host is connected. baud: its rate, if a UART is behind it. */
  static async open(baud) {
    return SerialLink.#begin(await choosePort(), baud);
  }

  static async #begin(port, baud = USUAL_BAUD) {
    try {
      await port.open({ baudRate: baud });
      await port.setSignals({ dataTerminalReady: true });
    } catch (error) {
      throw new LinkError(`the port cannot be opened (${error.message}): does another program have it?`);
    }
    return { link: new SerialLink(port, baud), hello: { device: "the chosen port", repl: false, kept: false } };
  }

  /** Open a known port, with the REPL's. name: its name on the page. */
  static async at(port, repl, name) {
    const found = await SerialLink.#begin(port);
    found.hello.device = name;
    found.link.#work = new BoardWork(repl);
    found.hello.repl = true;
    return found;
  }

  constructor(port, baud = USUAL_BAUD) {
    this.#port = port;
    this.#baud = baud;
    this.#writer = port.writable.getWriter();
    this.#reader = port.readable.getReader();
    this.#read();
  }

  /** Let the user choose the port of the board's REPL, for `ask`. */
  async chooseRepl() {
    this.#work = new BoardWork(await choosePort());
  }

  /** Use this port for the REPL as well, or, if it has one of its own, the one that the user chooses: on an ESP32, where getting to
   * the REPL ends framestep. Each task then closes this link, and the board restarts; `again` connects to it. */
  async useEndingRepl(shared) {
    this.#work = new BoardWork(shared ? this.#port : await choosePort(), true, () => (shared ? this.#baud : USUAL_BAUD));
    this.#ends = true;
  }

  /** Run a task on the REPL, as framestep console's server does. Throws LinkError if its port has not been chosen. */
  async ask(task, values = {}) {
    if (!this.#work) throw new LinkError("the port of the REPL has not been chosen");
    if (!this.#ends) return this.#work[task](values);
    await this.close();
    const found = await this.#work[task](values);
    if (values.text !== undefined) this.#baud = JSON.parse(bareRig(values.text)).uart_baud ?? USUAL_BAUD;
    return found;
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
    // a board that has refused its rig file has the usual rate
    this.#tries += 1;
    const found = await SerialLink.#begin(this.#port, this.#ends && this.#tries % 2 === 0 ? USUAL_BAUD : this.#baud);
    found.link.#work = this.#work;
    found.link.#ends = this.#ends;
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
