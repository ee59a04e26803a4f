// The link without a server: Web Serial, in Chromium and its relatives. The user picks the port.

import { LinkError } from "./client.js";

const NOMINAL_BAUD = 115200; // meaningless on USB, but it has to be named

export const serialIsThere = () => "serial" in navigator;

export class SerialLink {
  onbytes = () => {};
  onend = () => {};
  #port;
  #writer;
  #reader;
  #ended = false;

  /** Opens a port that the user picks; DTR tells the device that a host is there. */
  static async open() {
    let port;
    try {
      port = await navigator.serial.requestPort();
    } catch {
      throw new LinkError("no port was chosen");
    }
    try {
      await port.open({ baudRate: NOMINAL_BAUD });
      await port.setSignals({ dataTerminalReady: true });
    } catch (error) {
      throw new LinkError(`the port cannot be opened (${error.message}): does another program have it?`);
    }
    return { link: new SerialLink(port), hello: { device: "the chosen port", repl: false, kept: false } };
  }

  constructor(port) {
    this.#port = port;
    this.#writer = port.writable.getWriter();
    this.#reader = port.readable.getReader();
    this.#read();
  }

  send(bytes) {
    this.#writer.write(bytes).catch((error) => this.#end(`the port takes nothing more: ${error.message}`));
  }

  async close() {
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
