// A terminal on a port of Web Serial.

import { ReplPort } from "./repl_port.js";

export class PortTerminal {
  #port;
  #terminal;

  /** Open a port. terminal: {text, end}, called with its output, and once with the reason if it ends by itself. Throws LinkError. */
  static async open(port, terminal) {
    const made = new PortTerminal();
    made.#terminal = terminal;
    made.#port = await ReplPort.open(port, (text) => made.#terminal?.text(text), () => {
      if (made.#terminal) made.close("the REPL's port has gone");
    });
    return made;
  }

  type(text) {
    this.#port.send(text).catch(() => {}); // the reader reports a lost port
  }

  /** Close the port. why: the reason for the user, or null. */
  async close(why) {
    const terminal = this.#terminal;
    this.#terminal = null;
    await this.#port.close();
    if (why) terminal?.end(why);
  }
}
