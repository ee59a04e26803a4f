// The emulated board, which runs in a worker (tools/framestep_emulator/board/worker.mjs has the messages). Its serial ports
// have the interface of Web Serial.

/** Events: "edges" with {records, nanos}, "ports" when `shown` has changed, "halted" with the reason. */
export class Board extends EventTarget {
  /** The board's present serial ports. */
  shown = 0;
  #worker;

  /** pins: levels from switches, {pin: 0 or 1}. */
  constructor(worker, image, files, pins) {
    super();
    this.#worker = worker;
    this.repl = new BoardPort(this, 0);
    this.protocol = new BoardPort(this, 1);
    worker.addEventListener("message", ({ data }) => this.#take(data));
    this.send({ do: "start", image, files, pins });
  }

  send(message) {
    this.#worker.postMessage(message);
  }

  /** Set a switch on a pin: 0, 1, or null for none. */
  setPin(pin, level) {
    this.send({ do: "pin", pin, level });
  }

  /** Switch the power off and on; the flash keeps its content. */
  reset() {
    this.send({ do: "reset" });
  }

  #take(message) {
    if (message.is === "data") {
      const { port, bytes } = message;
      this.send({ do: "took", port, bytes: bytes.length });
      [this.repl, this.protocol][port].deliver(bytes);
      return;
    }
    if (message.is === "ports") {
      this.shown = message.count;
      for (const port of [this.repl, this.protocol]) if (!port.shown) port.end();
    }
    this.dispatchEvent(new CustomEvent(message.is, { detail: message }));
  }
}

/** A serial port with the interface of Web Serial: open, setSignals, readable, writable, close. */
export class BoardPort {
  readable = null;
  writable = null;
  /** Whether the port is open, so the listener gets nothing. */
  taken = false;
  #listener = null;
  #board;
  #number;
  #to = null; // the reader of the stream

  constructor(board, number) {
    this.#board = board;
    this.#number = number;
  }

  get shown() {
    return this.#number < this.#board.shown;
  }

  /** Resolve once the board has this port. */
  async open() {
    if (this.taken) throw new Error("it is open already");
    this.taken = true;
    while (!this.shown) await new Promise((resolve) => this.#board.addEventListener("ports", resolve, { once: true }));
    this.readable = new ReadableStream({
      start: (to) => {
        this.#to = to;
      },
      cancel: () => {
        this.#to = null;
      },
    });
    this.writable = new WritableStream({ write: (bytes) => this.write(bytes) });
    this.#setOpen(true);
  }

  async setSignals() {}

  async close() {
    this.#forget();
    this.#setOpen(this.#listener !== null);
  }

  /** Listen to the port while nobody else has opened it. */
  listen(listener) {
    this.#listener = listener;
    this.#setOpen(true);
  }

  write(bytes) {
    this.#board.send({ do: "write", port: this.#number, bytes });
  }

  deliver(bytes) {
    if (this.#to) this.#to.enqueue(bytes);
    else if (!this.taken) this.#listener?.(bytes);
  }

  /** The board has left the bus, so the port has to be opened again. */
  end() {
    if (!this.#to) return;
    this.#to.close();
    this.#forget();
  }

  #forget() {
    this.taken = false;
    this.#to = this.readable = this.writable = null;
  }

  #setOpen(on) {
    this.#board.send({ do: "open", port: this.#number, on });
  }
}
