// Requests and their answers over a link. A link has send(bytes) and close(), and calls onbytes and onend.

import { ackCode, Decoder, encode, pack, unpack } from "./codec.js";
import { CODES, M, REQUESTS } from "./protocol.js";

const PATIENCE_MS = 3000;

/** The device has refused a request; `code` is the response code, `motor` the request's, if it names one. */
export class Refused extends Error {
  constructor(request, code) {
    const [name, meaning] = CODES[code] ?? [`code ${code}`, "the specification has no such code"];
    super(`${REQUESTS[request].name} was refused with ${name}: ${meaning}`);
    this.request = request;
    this.code = code;
  }

  /** Return the device's reason, if there is one, instead of the meaning of the code. */
  because(reason) {
    if (reason) this.message = `Refused: ${reason}`;
  }
}

/** The link has ended, or no answer came in time. `held`: another page has the device. */
export class LinkError extends Error {
  constructor(text, held = false) {
    super(text);
    this.held = held;
  }
}

export class Client {
  #link;
  #decoder = new Decoder();
  #nextId = 1;
  #waiting = new Map(); // id -> {request, resolve, reject, timer}

  /** onreport: called with each unasked message, {kind, …}; onend: called once, with the reason and the link. */
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
      onend(why, link);
    };
  }

  /** Send a request. Resolves to its reply {kind, …}, or {} for an acknowledgement. Throws Refused, LinkError, RangeError. */
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

  /** Run a task of the server. Throws LinkError over a link without a server. */
  ask(task, values) {
    if (!this.#link.ask) return Promise.reject(new LinkError("this needs framestep console on the computer"));
    return this.#link.ask(task, values);
  }

  /** Set whether a run goes on without this page. Only a server can keep the port open. */
  keep(on) {
    this.#link.keep?.(on);
  }

  /** The pages that watch this one: [{number, who}]. */
  get pages() {
    return this.#link.pages ?? [];
  }

  handOver(number) {
    this.#link.handOver(number);
  }

  /** Whether the link can keep a run going without the page. */
  get keeps() {
    return Boolean(this.#link.keep);
  }

  /** Whether the user can choose a separate port for the board's REPL: Web Serial. */
  get choosesRepl() {
    return Boolean(this.#link.chooseRepl);
  }

  chooseRepl() {
    return this.#link.chooseRepl();
  }

  /** Use a REPL that ends framestep: see SerialLink. */
  useEndingRepl(shared) {
    return this.#link.useEndingRepl(shared);
  }

  /** Open a terminal on the REPL's port; `type` and `closeTerminal` are for it. Throws LinkError. */
  openTerminal(terminal) {
    return this.#link.openTerminal(terminal);
  }

  type(text) {
    this.#link.type(text);
  }

  closeTerminal() {
    return this.#link.closeTerminal();
  }

  /** Open the same port again, {link, hello}, over a link without a server. */
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
