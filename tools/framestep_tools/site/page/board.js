// The emulated board, which runs in a worker (tools/framestep_emulator/board/worker.mjs has the messages). Its serial ports look
// like those of Web Serial.

/** Events: "edges" with {records, nanos}, "ports" when `shown` has changed, "halted" with the reason. */
export class Board extends EventTarget {
  /** Serial ports that the board shows now. */
  shown = 0;
  #worker;

  /** pins: levels that switches give, {pin: 0 or 1}. */
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

  /** A switch on a pin: 0, 1, or null for nothing there. */
  setPin(pin, level) {
    this.send({ do: "pin", pin, level });
  }

  /** Power off and on again; the flash is kept. */
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

/** A serial port as Web Serial has it: open, setSignals, readable, writable, close. */
export class BoardPort {
  readable = null;
  writable = null;
  /** Whether somebody has opened it, so that there is nothing for the listener. */
  taken = false;
  #listener = null;
  #board;
  #number;
  #to = null; // what reads the stream

  constructor(board, number) {
    this.#board = board;
    this.#number = number;
  }

  get shown() {
    return this.#number < this.#board.shown;
  }

  /** Resolves once the board shows the port. */
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

  /** Get what comes while nobody has opened the port; it is open for that. */
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

  /** The board has gone from the bus: whoever had the port open has to open it again. */
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
