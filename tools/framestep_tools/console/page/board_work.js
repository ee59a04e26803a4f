// Rig file and load without a server: the page uses the board's REPL through a second port of Web Serial. The board
// checks the rig file.

import { LinkError } from "./client.js";
import { SCRIPTS } from "./protocol.js";
import { Repl } from "./repl.js";
import { PortTerminal } from "./port_terminal.js";
import { bareRig, mistake } from "./rig_text.js";

const TEXT_CHUNK = 200; // characters of a rig file in one script: little memory is free
const TAKEN = "the page itself uses the REPL, for the rig file or the load";
const MARK = "\x02";

/** Run a script and return its output after the mark. */
async function output(repl, script) {
  return (await repl.run(script)).split(MARK).at(-1).trim();
}

function lines(said) {
  return said.split(/\r?\n/).map((line) => line.trim()).filter(Boolean);
}

/** Tasks with the names of the server's. Each opens the port and closes it again. */
export class BoardWork {
  #port;
  #baud; // a function that gives the port's rate
  #restarts;
  #watched = null;
  #schema = null;
  #terminal = null; // {port reader, writer, end}
  #turn = Promise.resolve();

  /** port: the REPL's port of Web Serial. restarts: getting to the REPL ends framestep, so the board restarts after each task.
   * baud: returns the port's rate. */
  constructor(port, restarts = false, baud = () => undefined) {
    this.#port = port;
    this.#restarts = restarts;
    this.#baud = baud;
  }

  read_rig() {
    return this.#with((repl) => this.#read(repl));
  }

  check_rig({ text }) {
    return this.#with(async (repl) => ({ text: await this.#check(repl, bareRig(text)) }));
  }

  /** Write the rig file. Then the board restarts, and both of its ports disappear for a moment. `before` is for `restore_rig`. */
  write_rig({ text }) {
    return this.#with(async (repl) => {
      const bare = bareRig(text);
      const found = await this.#check(repl, bare);
      const before = await this.#read(repl);
      await this.#replace(repl, bare);
      return { text: `${found}; the board restarts with it`, restarts: true, before };
    });
  }

  /** Restore the file that `write_rig` has replaced; the board restarts. */
  restore_rig({ text, there }) {
    return this.#with(async (repl) => {
      await this.#replace(repl, there ? text : null);
      return {};
    });
  }

  load() {
    return this.#with(async (repl) => ({ lines: lines(await output(repl, SCRIPTS.load)) }));
  }

  /** Return the load as numbers. The port stays open until `rest`, or until another task. */
  live() {
    return this.#next(async () => {
      await this.#endTerminal(TAKEN);
      try {
        if (!this.#watched) {
          this.#watched = await Repl.open(this.#port, this.#baud());
          await this.#watched.run(SCRIPTS.live_begin);
        }
        const said = await output(this.#watched, SCRIPTS.live);
        if (!said.startsWith("[")) throw new LinkError(said);
        return { figures: JSON.parse(said) };
      } catch (error) {
        await this.#closeWatched();
        throw error;
      }
    });
  }

  rest() {
    return this.#next(async () => {
      await this.#closeWatched();
      return {};
    });
  }

  /** Open the port as a terminal, until `closeTerminal` or another task. text: called with the output; end: once, with the
   * reason, if it ends by itself. */
  openTerminal(terminal) {
    return this.#next(async () => {
      await this.#closeWatched();
      await this.#endTerminal("the terminal was opened again");
      this.#terminal = await PortTerminal.open(this.#port, terminal);
    });
  }

  type(text) {
    this.#terminal?.type(text);
  }

  closeTerminal() {
    return this.#next(() => this.#endTerminal(null));
  }

  async #endTerminal(why) {
    const terminal = this.#terminal;
    this.#terminal = null;
    await terminal?.close(why);
  }

  async #closeWatched() {
    const repl = this.#watched;
    this.#watched = null;
    if (!repl) return;
    await repl.run(SCRIPTS.live_end).catch(() => {});
    await repl.close();
  }

  async #read(repl) {
    const pieces = lines(await output(repl, SCRIPTS.read)).map((line) => JSON.parse(line));
    return { text: pieces.length ? pieces.join("") : "{}\n", there: pieces.length > 0 };
  }

  /** Check a rig file and return the board's greeting for it. Throws LinkError for a mistake. The schema decides first, the
   * board last. */
  async #check(repl, text) {
    this.#schema ??= await (await fetch("rig.schema.json")).json();
    const wrong = mistake(JSON.parse(text), this.#schema);
    if (wrong) throw new LinkError(`rig.json: ${wrong}`);
    await this.#put(repl, text);
    const [right, said] = JSON.parse(await output(repl, SCRIPTS.check));
    if (right === null) return "each setting is right; the board has no memory left to check them together";
    if (!right) throw new LinkError(`rig.json: ${said}`);
    return said;
  }

  /** Stop framestep, write the file (null: remove it) and restart. Changes nothing while motors move. */
  async #replace(repl, text) {
    if (await output(repl, SCRIPTS.halt) !== "0") throw new LinkError("motors move, or a run is prepared; nothing has been changed");
    let arrived = true;
    try {
      if (text === null) await repl.run(SCRIPTS.remove);
      else {
        await this.#put(repl, text);
        arrived = await output(repl, SCRIPTS.write) === "1";
      }
    } finally {
      await repl.runAndLeave(SCRIPTS.restart);
    }
    if (!arrived) throw new LinkError("the rig file did not arrive as it was sent; the board has the old one, and restarts");
  }

  /** Set the variable `text` on the board. */
  async #put(repl, text) {
    await repl.run("text = ''");
    for (let at = 0; at < text.length; at += TEXT_CHUNK) await repl.run(`text += ${JSON.stringify(text.slice(at, at + TEXT_CHUNK))}`);
  }

  #with(work) {
    return this.#next(async () => {
      await this.#closeWatched();
      await this.#endTerminal(TAKEN);
      const repl = await Repl.open(this.#port, this.#baud());
      try {
        if (this.#restarts) await repl.run(SCRIPTS.free);
        return await work(repl);
      } finally {
        if (!this.#restarts) await repl.run("text = None").catch(() => {});
        else if (!repl.left) await repl.runAndLeave(SCRIPTS.restart).catch(() => {});
        await repl.close();
      }
    });
  }

  /** Run one task at a time. */
  #next(work) {
    const done = this.#turn.then(work);
    this.#turn = done.catch(() => {});
    return done;
  }
}
