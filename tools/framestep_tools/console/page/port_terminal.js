// A terminal on a port of Web Serial.

import { LinkError } from "./client.js";

const NOMINAL_BAUD = 115200; // meaningless on USB, but required

export class PortTerminal {
  #port;
  #reader;
  #writer;
  #terminal;

  /** Open a port. terminal: {text, end}, called with its output, and once with the reason if it ends by itself. Throws LinkError. */
  static async open(port, terminal) {
    const made = new PortTerminal();
    try {
      await port.open({ baudRate: NOMINAL_BAUD });
      await port.setSignals({ dataTerminalReady: true });
    } catch (error) {
      throw new LinkError(`the REPL's port cannot be opened (${error.message}): does another program have it, or is it the protocol's?`);
    }
    made.#port = port;
    made.#terminal = terminal;
    made.#reader = port.readable.getReader();
    made.#writer = port.writable.getWriter();
    made.#listen();
    return made;
  }

  type(text) {
    this.#writer.write(new TextEncoder().encode(text)).catch(() => {}); // the reader reports a lost port
  }

  /** Close the port. why: the reason for the user, or null. */
  async close(why) {
    const terminal = this.#terminal;
    this.#terminal = null;
    await this.#reader.cancel().catch(() => {});
    this.#reader.releaseLock();
    this.#writer.releaseLock();
    await this.#port.close().catch(() => {});
    if (why) terminal?.end(why);
  }

  async #listen() {
    const decoder = new TextDecoder();
    try {
      for (;;) {
        const { value, done } = await this.#reader.read();
        if (done) break;
        this.#terminal?.text(decoder.decode(value, { stream: true }));
      }
    } catch { /* the cable has been pulled, or the board restarts */ }
    if (this.#terminal) await this.close("the REPL's port has gone");
  }
}
