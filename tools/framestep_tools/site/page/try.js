// framestep in a browser tab: an emulated board with the image of a Pico or a Pico 2, its console and its REPL.

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

const { boards } = setup;
const asked = new URLSearchParams(location.search).get("board");
const chosen = Object.hasOwn(boards, asked) ? asked : setup.board;
const { name, chip, image, files, closed, pins } = boards[chosen];
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
  const loaded = await Promise.all([load(image), load(files)]);
  return new Board(worker, ...loaded, closed);
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
  const others = [["DMX", pins.dmx?.tx], ["Shutter", pins.shutter], ["Meter", pins.meter]].filter(([, pin]) => pin !== undefined);
  return [...motors, ...others.map(([title, pin]) => [pin, `${title} · GP${pin}`])];
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
const choice = h("select", { "aria-label": "Emulated board", onchange: () => { location.search = `?board=${choice.value}`; } },
  ...Object.entries(boards).map(([value, each]) => h("option", { value }, each.name)));
choice.value = chosen;
const terminal = new ReplTerminal(board.repl, choice, power);
if (!device.axes.list.length) device.axes.set(setup.axes);
const running = start(() => SerialLink.at(board.protocol, board.repl, "a board in this page"));
const about = h("p", { class: "faint" },
  "What runs here is ", h("a", { href: image }, `the image for a ${name}`), `, on an emulated ${chip}. Nothing leaves this page. `,
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
