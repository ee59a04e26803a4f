// framestep in a browser tab: an emulated board with the image of a Pico, its console and its REPL.

import "framestep-console/style.css";
import "@xterm/xterm/css/xterm.css";
import "./try.css";
import { addDrawer, addEstop, addTour, start } from "framestep-console/app.js";
import { h, setText } from "framestep-console/dom.js";
import { device } from "framestep-console/session.js";
import { SerialLink } from "framestep-console/serial_link.js";
import { Board } from "./board.js";
import setup from "framestep-console/setup.json";
import { Pins } from "./pins.js";
import { Scope } from "./scope.js";
import { ReplTerminal } from "./terminal.js";

const { pins } = setup;
const PRESSED = 1; // the E-stop is normally closed: pressed, it lets its pin go high
const RELEASED = 0;
const DRAWN_MS = 40;

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

/** Put the example move onto the desk, and set the velocities that it needs. */
async function takeExample() {
  for (const i of pins.step.keys()) {
    await running.device.ask("MotorSetSpeed", { motor: i + 1, ...setup.speed });
    await running.device.seeSettings(i + 1);
  }
  await running.work.takeText(new TextDecoder().decode(await load(setup.example)), setup.example);
}

/** Return the scope's pins, [pin, name]. */
function shownPins() {
  const motors = pins.step.flatMap((pin, i) => [[pin, `Step ${i + 1} · GP${pin}`], [pins.dir[i], `Direction ${i + 1} · GP${pins.dir[i]}`]]);
  return [...motors, [pins.dmx.tx, `DMX · GP${pins.dmx.tx}`], [pins.shutter, `Shutter · GP${pins.shutter}`], [pins.meter, `Meter · GP${pins.meter}`]];
}

/** Draw repeatedly while the page is visible. */
function keepDrawing(...parts) {
  let last = 0;
  const turn = (now) => {
    if (now - last >= DRAWN_MS) {
      last = now;
      for (const part of parts) part.draw();
    }
    requestAnimationFrame(turn);
  };
  requestAnimationFrame(turn);
}

const bench = h("div", { id: "bench" });
addDrawer("board", "Board", bench, "M7 7h10v10H7zM10 3v4M14 3v4M10 17v4M14 17v4M3 10h4M3 14h4M17 10h4M17 14h4");
document.body.classList.add("try");
const who = document.querySelector("#who");
setText(who, "The board starts …");
let board;
try {
  board = await makeBoard();
} catch (error) {
  setText(who, error.message);
  throw error;
}
const traced = new Pins(board, pins);
const estop = addEstop((on) => board.setPin(pins.estop, on ? PRESSED : RELEASED));
const scope = new Scope(traced, shownPins());
const power = h("button", { type: "button", onclick: () => board.reset() }, "Power off and on");
const terminal = new ReplTerminal(board.repl, power);
if (!device.axes.list.length) device.axes.set(setup.axes);
const running = start(() => SerialLink.at(board.protocol, board.repl, "a board in this page"));
const about = h("p", { class: "faint" },
  "What runs here is ", h("a", { href: setup.image }, "the image for a Pico"), ", on an emulated RP2040. Nothing leaves this page. ",
  h("a", { href: "licences.txt" }, "Licences"), " of the packages that it is made of.");
bench.append(scope.element, terminal.element, about);
running.drawer("board", true);
const repl = {
  get lines() { return terminal.lines; },
  enter(line) {
    running.drawer("board", true);
    terminal.enter(line);
  },
};
addTour({ estop, repl, takeExample });
keepDrawing(scope);
running.device.addEventListener("connected", () => terminal.greet());
board.addEventListener("halted", ({ detail }) => running.device.tell(`The board has stopped: ${detail.why}`, true));
