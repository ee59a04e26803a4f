// framestep in a browser tab: an emulated board with the image of a Pico, the console before it, its REPL beside it.

import "framestep-console/style.css";
import "@xterm/xterm/css/xterm.css";
import "./try.css";
import { start } from "framestep-console/app.js";
import { h } from "framestep-console/dom.js";
import { SerialLink } from "framestep-console/serial_link.js";
import { Board } from "./board.js";
import setup from "framestep-console/setup.json";
import { ReplTerminal } from "./terminal.js";

async function load(name) {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name} is not there (${answer.status})`);
  return answer.arrayBuffer();
}

async function makeBoard() {
  const worker = new Worker("board_worker.js");
  const [image, files] = await Promise.all([load(setup.image), load(setup.files)]);
  return new Board(worker, image, files, setup.closed);
}

function place(bench) {
  const parts = ["header", "#lost", "nav", "main"].map((name) => document.querySelector(name));
  document.body.classList.add("try");
  document.body.prepend(h("div", { id: "console" }, ...parts), bench);
}

const bench = h("aside", { id: "bench", "aria-label": "The board" });
place(bench);
const board = await makeBoard();
globalThis.board = board; // for the browser's console
const terminal = new ReplTerminal(board.repl);
bench.append(terminal.element);
const device = start(() => SerialLink.at(board.protocol, board.repl));
device.addEventListener("connected", () => terminal.greet());
