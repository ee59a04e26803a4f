// Requests and their answers over a link. A link has send(bytes), close(), and calls onbytes and onend.

import { ackCode, Decoder, encode, pack, unpack } from "./codec.js";
import { CODES, M, REQUESTS } from "./protocol.js";

const PATIENCE_MS = 3000;

/** The device did not take a request; `code` is the response code. */
export class Refused extends Error {
  constructor(request, code) {
    const [name, meaning] = CODES[code] ?? [`code ${code}`, "the specification has no such code"];
    super(`${REQUESTS[request].name} was refused with ${name}: ${meaning}`);
    this.request = request;
    this.code = code;
  }

  /** Give the reason that the device has told, if there is one, instead of the meaning of the code. */
  because(reason) {
    if (reason) this.message = `${REQUESTS[this.request].name} was refused: ${reason}`;
  }
}

/** The link has ended, or nothing came in time. */
export class LinkError extends Error {}

export class Client {
  #link;
  #decoder = new Decoder();
  #nextId = 1;
  #waiting = new Map(); // id -> {request, resolve, reject, timer}

  /** onreport: called with each message that the device sends unasked, {kind, …}. onend: once, with the reason. */
  constructor(link, onreport, onend) {
    this.#link = link;
    link.onbytes = (bytes) => {
      for (const frame of this.#decoder.feed(bytes)) this.#take(frame, onreport);
    };
    link.onend = (why) => {
      for (const { reject, timer } of this.#waiting.values()) {
        clearTimeout(timer);
        reject(new LinkError(why));
      }
      this.#waiting.clear();
      onend(why);
    };
  }

  /** Send a request; its reply {kind, …}, or {} for an acknowledgement. Refused, LinkError, RangeError. */
  request(request, values = {}) {
    const id = this.#nextId;
    this.#nextId = (id % 0x7fffffff) + 1;
    return new Promise((resolve, reject) => {
      const frame = encode(REQUESTS[request].type, pack(request, values), id);
      const timer = setTimeout(() => {
        this.#waiting.delete(id);
        reject(new LinkError(`no answer to ${REQUESTS[request].name} within ${PATIENCE_MS / 1000} s`));
      }, PATIENCE_MS);
      this.#waiting.set(id, { request, resolve, reject, timer });
      this.#link.send(frame);
    });
  }

  /** What the server does beside the protocol; LinkError over a link that has no server. */
  ask(task, values) {
    if (!this.#link.ask) return Promise.reject(new LinkError("this needs framestep console on the computer"));
    return this.#link.ask(task, values);
  }

  /** Whether a run goes on when this page has gone. Only a server can keep the port open. */
  keep(on) {
    this.#link.keep?.(on);
  }

  /** Whether the link can keep a run going without the page. */
  get keeps() {
    return Boolean(this.#link.keep);
  }

  /** Whether the page can have the board's REPL by a port of its own, which the user chooses: Web Serial. */
  get choosesRepl() {
    return Boolean(this.#link.chooseRepl);
  }

  chooseRepl() {
    return this.#link.chooseRepl();
  }

  /** The same port once more, {link, hello}, over a link without a server. */
  again() {
    return this.#link.again();
  }

  close() {
    this.#link.close();
  }

  #take(frame, onreport) {
    const asked = frame.id ? this.#waiting.get(frame.id) : undefined;
    if (!asked) {
      const report = frame.id === 0 && !frame.ack ? unpack(frame.type, frame.payload) : null;
      if (report) onreport(report);
      return;
    }
    if (frame.type !== REQUESTS[asked.request].type) return;
    this.#waiting.delete(frame.id);
    clearTimeout(asked.timer);
    if (!frame.ack) {
      asked.resolve(unpack(frame.type, frame.payload) ?? {});
      return;
    }
    const code = ackCode(frame.payload);
    if (code === M.OK) asked.resolve({});
    else asked.reject(new Refused(asked.request, code));
  }
}
