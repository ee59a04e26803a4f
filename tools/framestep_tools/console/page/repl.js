// A board's raw REPL at a port of Web Serial: scripts in, their output out. Nothing is reset, and framestep goes on, except on an
// ESP32.

import { LinkError } from "./client.js";
import { ReplPort } from "./repl_port.js";

const CHUNK = 256; // bytes that MicroPython accepts at a time
const PATIENCE_MS = 10_000;
const INTERRUPT = "\x03";
const RAW = "\x01";
const FRIENDLY = "\x02";
const END = "\x04";
const PROMPT = "raw REPL; CTRL-B to exit\r\n>";

export class Repl {
  #port;
  #heard = "";
  #wake = () => {};
  #ended = false;
  #left = false; // the board no longer answers

  /** Open a port that the user has chosen, and reach its REPL. Throws LinkError if there is none. */
  static async open(port, baud) {
    const repl = new Repl();
    repl.#port = await ReplPort.open(port, (text) => {
      repl.#heard += text;
      repl.#wake();
    }, () => {
      repl.#ended = true;
      repl.#wake();
    }, baud);
    try {
      await repl.#send(`\r${INTERRUPT}\r${RAW}`);
      await repl.#until(PROMPT, "no REPL answers at this port: choose the one named MicroPython, or the other one");
    } catch (error) {
      await repl.close();
      throw error;
    }
    return repl;
  }

  /** Run a script and return its output. Throws LinkError with the last line of a traceback. */
  async run(script) {
    if (this.#left) throw new LinkError("the board restarts");
    const bytes = new TextEncoder().encode(script);
    for (let at = 0; at < bytes.length; at += CHUNK) await this.#port.write(bytes.subarray(at, at + CHUNK));
    await this.#send(END);
    await this.#until("OK", "the board does not accept a script");
    const said = await this.#until(END, "the board does not come to an end");
    const failed = await this.#until(`${END}>`, "the board does not come to an end");
    if (failed.trim()) throw new LinkError(`the board reported an error: ${failed.trim().split("\n").at(-1)}`);
    return said;
  }

  /** Whether a script has ended the answers. */
  get left() {
    return this.#left;
  }

  /** Run a script after which the board no longer answers. */
  async runAndLeave(script) {
    this.#left = true;
    await this.#send(script + END);
    await this.#until("OK", "the board does not accept a script"); // closing the port too early would lose the script
  }

  /** Leave the REPL as a terminal expects it. */
  async close() {
    if (!this.#left) await this.#send(`\r${FRIENDLY}`).catch(() => {});
    await this.#port.close();
  }

  #send(text) {
    return this.#port.send(text);
  }

  /** Return the output before a mark, and remove both. */
  async #until(mark, otherwise) {
    const end = performance.now() + PATIENCE_MS;
    for (;;) {
      const at = this.#heard.indexOf(mark);
      if (at >= 0) {
        const found = this.#heard.slice(0, at);
        this.#heard = this.#heard.slice(at + mark.length);
        return found;
      }
      const left = end - performance.now();
      if (this.#ended) throw new LinkError("the REPL's port has gone");
      if (left <= 0) throw new LinkError(otherwise);
      await new Promise((resolve) => {
        const timer = setTimeout(resolve, left);
        this.#wake = () => {
          clearTimeout(timer);
          resolve();
        };
      });
    }
  }
}
