// A tour in six steps. A step is done when the board shows it, whoever did it.

import { h, setText } from "framestep-console/dom.js";
import { M } from "framestep-console/protocol.js";

const LOOK_MS = 200;
const MARKED_MS = 4000;
const FAR = 100; // steps that count as a jog
const COMMAND = "status()";

/** The steps. `begin` returns a function that returns whether the step is done. */
function steps({ device, work, operation, pins, estop, terminal, takeExample }) {
  return [
    {
      title: "Jog a motor",
      text: "Hold + of the first motor. The carriage rolls, and the scope shows its pulses. Let go, and it ramps down.",
      control: '#rows li:first-child .hold:last-child',
      begin() {
        const before = pins.steps[0];
        return () => Math.abs(pins.steps[0] - before) > FAR && device.knowsWhatMoves && !device.moves(1);
      },
    },
    {
      title: "Set its zero",
      text: "After power-up framestep does not know where a stepper motor is. Choose the first motor and press “Zero here”.",
      control: "#chosen article:not([hidden]) .zero",
      begin: () => () => device.trustOf(1)?.state === "known",
    },
    {
      title: "Take a move",
      text: "A move is a position of each motor for each frame. Take the example, ten seconds of a crane on a track: it sets the motors' speeds, too.",
      control: "#file",
      action: ["Take the example", takeExample],
      begin: () => () => work.move !== null && !work.editable,
    },
    {
      title: "Run it",
      text: "Press “Get ready”: the move goes to the board, and the motors to where it begins. Then press “GO”. Each motor makes its steps on its frame to some microseconds.",
      control: "#ready",
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
      text: "Run it again, and press the red button while it moves: all motors ramp down at once, and the page says why. Press it once more to let go.",
      control: ".estop",
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
      text: `The firmware is Python, and you can talk to it while it runs: type ${COMMAND} and Enter.`,
      control: '[aria-label="REPL"]',
      action: ["Type it for me", () => terminal.enter(COMMAND)],
      begin() {
        const before = terminal.lines;
        return () => terminal.lines > before;
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

  constructor(parts) {
    this.#steps = steps(parts).map((step, i) => {
      const title = h("button", { type: "button", onclick: () => this.#show(i) }, step.title);
      const body = h("div", { class: "tour-step" }, h("p", {}, step.text), h("div", { class: "row" },
        h("button", { type: "button", onclick: () => mark(step) }, "Show me where"),
        step.action ? h("button", { type: "button", onclick: step.action[1] }, step.action[0]) : null));
      const item = h("li", {}, title, body);
      this.#list.append(item);
      return { ...step, item, title, body };
    });
    this.element.append(this.#list, this.#said);
    this.#show(0);
    setInterval(() => this.#look(), LOOK_MS);
  }

  #show(i) {
    this.#at = i;
    for (const [j, { title, body }] of this.#steps.entries()) {
      body.hidden = j !== i;
      if (j === i) title.setAttribute("aria-current", "step");
      else title.removeAttribute("aria-current");
    }
    this.#isDone = this.#steps[i]?.begin() ?? (() => false);
  }

  #look() {
    if (!this.#isDone()) return;
    const { item, title } = this.#steps[this.#at];
    item.classList.add("done");
    const next = this.#steps.findIndex((step) => !step.item.classList.contains("done"));
    setText(this.#said, `Done: ${title.textContent}.${next < 0 ? " That was the tour; all of the console works on this board." : ""}`);
    this.#show(next);
  }
}
