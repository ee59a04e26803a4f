// A tour in six steps on a simulated or emulated board. A step is done when the board shows it, whoever did it.

import { h, setText } from "./dom.js";
import { M } from "./protocol.js";

const LOOK_MS = 200;
const MARKED_MS = 4000;
const FAR = 100; // steps that count as a jog
const SEEN = 20; // frames that count as a look at the move
const COMMAND = "status()";

/** The steps. `begin` returns a function that returns whether the step is done; page: where a phone has it. */
function steps({ device, work, operation, estop, repl, takeExample }) {
  const example = {
    title: "Take a move",
    text: "A move is a position of each motor for each frame. Take the example, ten seconds of a crane on a track: it sets the motors' speeds, too.",
    control: "#file",
    page: "move",
    action: ["Take the example", takeExample],
    begin: () => () => work.move !== null && !work.editable,
  };
  const preview = {
    title: "Look at the move",
    text: "Drag the blue flag along the time line, or press Space: the dashed rig goes through the move, the real one stays. Press a diamond's word to go smoothly, straight, or in jumps.",
    control: "#curves",
    page: "move",
    begin() {
      const before = work.see;
      return () => Math.abs(work.see - before) > SEEN && !operation.playing;
    },
  };
  return [
    {
      title: "Jog a motor",
      text: "Hold + of the first motor, or the key →. The track rolls; let go, and it ramps down.",
      control: "#rows li:first-child .hold:last-child",
      page: "jog",
      begin() {
        let before; // the device reports it soon
        return () => {
          const [at] = device.state.positions;
          before ??= at;
          return Math.abs(at - before) > FAR && device.knowsWhatMoves && !device.moves(1);
        };
      },
    },
    {
      title: "Say where it is",
      text: "After power-up framestep does not know where stepper motors are; you say it. Choose the first motor and press “Zero here”; for the others “Positions…”, and twice “All are as shown”.",
      control: "#home",
      page: "jog",
      begin: () => () => device.knowsWhatMoves && device.lost.length === 0 && device.state.positions[0] === 0,
    },
    takeExample ? example : preview,
    {
      title: "Run it",
      text: "Press “Get ready”: the move goes to the board, and the motors to where it begins. Then press “GO”. Each motor makes its steps on its frame to some microseconds.",
      control: "#ready",
      page: "take",
      begin() {
        let played = false;
        return () => {
          played ||= operation.playing;
          return played && !operation.playing;
        };
      },
    },
    {
      title: "Press the E-stop",
      text: "Run it again, and press the red button at the top while it moves: all motors ramp down at once, and the page says why. Press it once more to let go.",
      control: ".estop",
      page: "take",
      begin() {
        let stopped = false;
        device.addEventListener("hardstop", ({ detail }) => {
          stopped ||= detail.reason === M.HARD_STOP_GENERAL;
        });
        return () => stopped && estop.getAttribute("aria-pressed") === "false";
      },
    },
    {
      title: "Type on its REPL",
      text: `You can talk to the board while it runs: type ${COMMAND} and Enter.`,
      control: '[aria-label="REPL"]',
      action: ["Type it for me", () => repl.enter(COMMAND)],
      begin() {
        const before = repl.lines;
        return () => repl.lines > before;
      },
    },
  ];
}

/** Scroll to a control, and mark it for a moment. */
function mark({ control }) {
  const found = document.querySelector(control);
  if (!found) return;
  found.scrollIntoView({ block: "center" });
  found.classList.add("marked");
  setTimeout(() => found.classList.remove("marked"), MARKED_MS);
}

export class Tour {
  element = h("article", { class: "tour", "aria-label": "Tour" });
  #list = h("ol");
  #said = h("p", { class: "faint", role: "status" });
  #steps;
  #at = -1;
  #isDone = () => false;

  /** parts: {device, work, operation, estop, repl: {enter(line), lines}, takeExample: null if the page has a move, show(page): called before a place is marked}. */
  constructor(parts) {
    this.#steps = steps(parts).map((step, i) => {
      const button = h("button", { type: "button", "aria-label": `Step ${i + 1}: ${step.title}`, onclick: () => this.#show(i) }, String(i + 1));
      const where = () => {
        parts.show(step.page);
        mark(step);
      };
      const body = h("div", { class: "tour-step" }, h("h3", {}, step.title), h("p", {}, step.text), h("div", { class: "row" },
        h("button", { type: "button", onclick: where }, "Show me where"),
        step.action ? h("button", { type: "button", onclick: step.action[1] }, step.action[0]) : null));
      const item = h("li", {}, button, body);
      this.#list.append(item);
      return { ...step, item, button, body };
    });
    this.element.append(this.#list, this.#said);
    this.#show(0);
    setInterval(() => this.#look(), LOOK_MS);
  }

  #show(i) {
    this.#at = i;
    for (const [j, { button, body }] of this.#steps.entries()) {
      body.hidden = j !== i;
      if (j === i) button.setAttribute("aria-current", "step");
      else button.removeAttribute("aria-current");
    }
    this.#isDone = this.#steps[i]?.begin() ?? (() => false);
  }

  #look() {
    if (!this.#isDone()) return;
    const { item, title } = this.#steps[this.#at];
    item.classList.add("done");
    const next = this.#steps.findIndex((step) => !step.item.classList.contains("done"));
    setText(this.#said, `Done: ${title}.${next < 0 ? " That was the tour; all of the console works on this board." : ""}`);
    this.#show(next);
  }
}
