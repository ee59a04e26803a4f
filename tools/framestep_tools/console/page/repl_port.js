// The port of a board's REPL, by Web Serial, as text.

import { LinkError } from "./client.js";

export const USUAL_BAUD = 115200; // meaningless on USB, but required

export class ReplPort {
  #port;
  #reader;
  #writer;

  /** Open a port that the user has chosen. ontext(text): called with its output; onend: called once nothing comes any more, also
   * after `close`; baud: its rate, if a UART is behind it. Throws LinkError. */
  static async open(port, ontext, onend, baud = USUAL_BAUD) {
    const made = new ReplPort();
    try {
      await port.open({ baudRate: baud });
      await port.setSignals({ dataTerminalReady: true });
    } catch (error) {
      throw new LinkError(`the REPL's port cannot be opened (${error.message}): does another program have it, or is it the protocol's?`);
    }
    made.#port = port;
    made.#reader = port.readable.getReader();
    made.#writer = port.writable.getWriter();
    made.#listen(ontext, onend);
    return made;
  }

  write(bytes) {
    return this.#writer.write(bytes);
  }

  send(text) {
    return this.write(new TextEncoder().encode(text));
  }

  async close() {
    await this.#reader.cancel().catch(() => {});
    this.#reader.releaseLock();
    this.#writer.releaseLock();
    await this.#port.close().catch(() => {});
  }

  async #listen(ontext, onend) {
    const decoder = new TextDecoder();
    try {
      for (;;) {
        const { value, done } = await this.#reader.read();
        if (done) break;
        ontext(decoder.decode(value, { stream: true }));
      }
    } catch { /* the cable has been pulled, or the board restarts */ }
    onend();
  }
}
