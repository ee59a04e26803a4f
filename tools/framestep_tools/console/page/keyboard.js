// The keys of the desk. Escape is STOP everywhere, see session.js; the others belong to fields while one has the focus.

import { h, takesText } from "./dom.js";

/** [keys, what they do], as the drawer Keys lists them. */
const LIST = [
  ["Esc", "STOP, everywhere, also in a field; twice within a second: harder"],
  ["1 … 9 0", "choose a motor"],
  ["↑ ↓", "choose the motor above, below"],
  ["← →", "jog the chosen motor, as long as held"],
  ["Shift + ← →", "one small step"],
  ["[ ]", "jog slower, faster"],
  [", .", "preview one frame back, on"],
  ["Home End", "preview to the first, the last frame"],
  ["Space", "play the preview; the rig stays"],
  ["Enter", "rig to the preview's frame"],
  ["K", "the rig's pose becomes a keyframe at the preview"],
  ["Del", "remove the keyframe at the preview"],
  ["Ctrl + Z", "undo a change of the keyframes"],
  ["R", "Get ready; in Frames: next frame"],
  ["Shift + Enter", "GO, SHOOT, START"],
  ["L", "loop: off, loop, ping-pong, there and back"],
  ["?", "this list"],
];
const LOUDER = 5; // percent of the jog speed

/** The content of the drawer. */
export function keyList() {
  return h("div", { class: "parts" }, h("table", { class: "keymap" }, h("tbody", {}, ...LIST.map(([keys, text]) => h("tr", {}, h("th", { scope: "row" }, h("kbd", {}, keys)), h("td", {}, text))))),
    h("p", { class: "faint" }, "Game controller: hold L1 or R1 and push the left stick sideways to jog; its cross chooses the motor, B is STOP. Tab and Enter reach every button."));
}

/** Listen. desk: {work, motors, transport, holds, drawer, play, put, remove, device}. */
export function listen(desk) {
  const { work, motors, transport, holds } = desk;
  const acts = {
    ArrowUp: () => motors.choose(work.chosen - 1),
    ArrowDown: () => motors.choose(work.chosen + 1),
    ",": () => work.look(work.see - 1),
    ".": () => work.look(work.see + 1),
    Home: () => work.look(work.domain[0]),
    End: () => work.look(work.move?.endFrame ?? work.domain[1]),
    k: () => desk.put(),
    Delete: () => desk.remove(),
    r: () => transport.ready(),
    l: () => transport.nextLoop(),
    "?": () => desk.drawer("keys"),
    "[": () => { motors.speed -= LOUDER; },
    "]": () => { motors.speed += LOUDER; },
  };
  window.addEventListener("keydown", (event) => {
    const { key, target, repeat, shiftKey } = event;
    if (takesText(target) && target.type !== "range") return;
    if ((event.ctrlKey || event.metaKey) && key.toLowerCase() === "z" && !event.altKey) {
      event.preventDefault();
      work.undo();
      return;
    }
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const onControl = target.closest?.("button, summary, a, input, [role=switch]");
    if (key === "Enter" && shiftKey) {
      event.preventDefault();
      if (!repeat) transport.go();
    } else if (key === "Enter" && !onControl) transport.send();
    else if (key === " " && !onControl) {
      event.preventDefault();
      if (!repeat) desk.play();
    } else if (/^[0-9]$/.test(key)) motors.chooseIfThere(Number(key) || 10);
    else if (key === "ArrowLeft" || key === "ArrowRight") {
      if (target.type === "range" || target.closest?.("#d-body")?.scrollWidth > target.closest?.("#d-body")?.clientWidth) return;
      event.preventDefault();
      if (repeat) return;
      if (shiftKey) motors.step(key === "ArrowRight");
      else motors.jog(key, key === "ArrowRight");
    } else {
      const act = acts[key.length === 1 ? key.toLowerCase() : key];
      if (!act || (target.type === "range" && /^(Arrow|Home|End)/.test(key))) return;
      if (/^(ArrowUp|ArrowDown|Home|End)$/.test(key) && target.closest?.("#d-body")) return; // they scroll the drawer
      event.preventDefault();
      act();
    }
  });
  window.addEventListener("keyup", (event) => holds.release(event.key));
}
