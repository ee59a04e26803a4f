// The console: one desk. The regions of index.html get their parts here, and the banner its state. `start` begins.

import { field, h, number, setText, Twice, twice, withPicture } from "./dom.js";
import { keyList, listen } from "./keyboard.js";
import { MoveDrawer } from "./move_drawer.js";
import { Motors } from "./motors.js";
import { Operation } from "./operation.js";
import { OutputsView } from "./outputs.js";
import { CONDITIONS, DRIVER_FAILED, M, VERSION } from "./protocol.js";
import { RigFileView } from "./rig_file_view.js";
import { RigView } from "./rig_view.js";
import { Series } from "./series.js";
import { serialIsThere } from "./serial_link.js";
import { device, holds, session } from "./session.js";
import { keepTheme } from "./theme.js";
import { Timeline } from "./timeline.js";
import { Transport } from "./transport.js";
import { Virtual } from "./virtual.js";
import { Tour } from "./tour.js";
import { CURES } from "./cures.js";
import { AxesView } from "./axes_view.js";
import { Work } from "./work.js";

const PLAYED = new Set(["RtRunMove", "RtPositionFrame", "RtJogAll", "RtShootFrame2", "RtGo"]);
const MESSAGES = 40; // kept in the log
const NARROW = matchMedia("(max-width: 700px), (max-height: 560px)");
const DOCKED = matchMedia("(min-width: 1700px) and (min-height: 900px)"); // the drawer has a column of its own
const MARKS = {
  good: "M5 13l4 4L19 7",
  ready: "M7 4l12 8-12 8z",
  moves: "M4 12h14M13 6l6 6-6 6",
  warn: "M12 4l9 16H3zM12 10v5M12 17.5v.1",
  bad: "M8 3h8l5 5v8l-5 5H8l-5-5V8zM12 7v6M12 16.5v.1",
  none: "M5 12h14",
  other: "M8 11a3 3 0 1 0 0-6 3 3 0 0 0 0 6M3 20c0-4 2-6 5-6s5 2 5 6M16 8h5M18.5 5.5v5",
};
const PLAYS = "M7 4l12 8-12 8z";
const PAUSES = "M7 4v16M17 4v16";

const due = withPicture(() => render());

const $ = (id) => document.getElementById(id);
const theme = h("select", { id: "theme" }, ...[["light dark", "as the system"], ["light", "light"], ["dark", "dark"]].map(([value, text]) => h("option", { value }, text)));
const fps = number(24, 0.001, 1000, { step: "0.001", inputMode: "decimal" });
const operation = new Operation(device);
const series = new Series(device, operation);
const work = new Work(device, fps);
let last = null; // how the last thing has ended: {kind: "over", "stopped", "refused", "switch", title, text}
let stopper = ""; // who has stopped last

/** What the parts of the desk share. */
const desk = {
  device,
  holds,
  work,
  operation,
  series,
  keepLine: session.keepLine,
  stop: () => stop(),
  /** Why the move cannot be played whatever is pressed; "" if it can. */
  get blocked() {
    if (session.estop) return "the E-stop is held";
    if (session.faultBits.length) return "there is a fault";
    return work.move?.motors.some((motor) => device.lost.includes(motor)) ? "positions are lost" : "";
  },
  forget: () => { last = null; },
  page: "take",
  get narrow() { return NARROW.matches; },
  get blind() { return session.blind !== ""; },
  /** Whether something can be asked of the device. */
  get usable() { return device.connected && !device.silent && device.state.movingKnown && !session.elsewhere; },
  drawer: (name, open) => openDrawer(name, open),
};

/** Note a refusal of what plays the move, and what the board would need. */
async function refuse(error) {
  if (!PLAYED.has(error.request)) return;
  last = { kind: "refused", title: "Refused", text: error.message.replace(/^Refused: /, "").replace(/: raise it .*/, "") };
  due();
  const told = await device.client?.request("GetExceeded").catch(() => null);
  if (!told) return;
  const { what, motor, by } = told;
  if (what === M.EXCEEDED_VELOCITY && told.velocity !== undefined) work.refused = { motor, velocity: told.velocity + by };
  if (what === M.EXCEEDED_ACCELERATION && told.acceleration !== undefined) work.refused = { motor, acceleration: told.acceleration + by };
  due();
}
device.addEventListener("refused", ({ detail }) => refuse(detail));

const transport = desk.transport = new Transport(desk, {
  element: $("transport"), modes: $("modes"), fields: $("fields"), ready: $("ready"), go: $("go"), send: $("send"), count: $("count"), countOf: $("count-of"), back: $("back"), forth: $("forth"), play: $("play"),
}, fps);
const motors = desk.motors = new Motors(desk, { rows: $("rows"), chosen: $("chosen"), speed: $("speed"), speedIs: $("speed-is") });
const timeline = new Timeline($("curves"), desk);
const virtual = desk.virtual = new Virtual(device, holds, () => rig.renew(), () => toSetup("Virtual axes"));
const rig = new RigView(desk, { space: $("space"), plan: $("plan"), pose: $("pose"), above: $("above") });
const move = new MoveDrawer(desk);
const outputs = new OutputsView(device);
const names = new AxesView(device);
const file = new RigFileView(device);
const parts = [transport, motors, virtual, move, outputs, names, file];

// ---- drawers

const log = h("div", { id: "log" });
const takes = h("table", {}, h("tbody"));
const conditions = h("ul", { id: "conditions", "aria-label": "Condition of the board" });
const byCable = h("button", { type: "button", class: "main", hidden: !serialIsThere(), onclick: () => session.byCable() }, "Connect over USB…");
const watching = h("ul", { "aria-label": "Pages that watch" });
const page = h("div", { class: "parts" }, h("div", { class: "row" }, byCable, field("Theme", theme)), watching,
  h("p", { class: "faint" }, "Whether runs go on without this page: Options… beside the run. A phone: framestep console --lan prints its QR code. Each page may stop at any time; one page at a time may move."));
const setup = { "Names and units": names.element, "Virtual axes": virtual.setup, "Rig file, load, terminal": file.element, "This page": page };
const setupNav = h("nav", { "aria-label": "Set up" });
const setupBody = h("section", {});
const drawers = {
  motor: ["Motor", motors.settings],
  positions: ["Set positions", motors.positions],
  move: ["The move", move.element],
  options: ["Options of the run", transport.options],
  camera: ["Camera, along its own axes", virtual.camera],
  lights: [outputs.title, outputs.element],
  log: ["Log", h("div", { class: "parts" }, h("h3", {}, "Takes"), takes, h("h3", {}, "Conditions"), conditions, h("h3", {}, "Messages"), log)],
  keys: ["Keys", keyList()],
  setup: ["Set up", h("div", { class: "setup" }, setupNav, setupBody)],
};
const MENU = ["camera", "lights", "log", "keys", "move", "options", "positions"]; // on a phone
let opened = null;
let part = "Names and units";

for (const [name, element] of Object.entries(setup)) {
  setupNav.append(h("button", { type: "button", onclick: () => toSetup(name) }, name));
  element.hidden = true;
  element.setAttribute("aria-label", name);
  element.setAttribute("role", "region");
  setupBody.append(element);
}
for (const name of MENU) setupNav.append(h("button", { type: "button", class: "phone-only", "data-to": name, onclick: () => openDrawer(name, true) }, drawers[name][0]));
for (const [name, [, element]] of Object.entries(drawers)) {
  element.dataset.name = name;
  element.hidden = true;
  $("d-body").append(element);
}

/** Add a drawer with a button for it. */
export function addDrawer(name, title, element, mark) {
  drawers[name] = [title, element];
  element.dataset.name = name;
  element.hidden = true;
  $("d-body").append(element);
  const button = h("button", { type: "button", "data-drawer": name, "aria-expanded": "false", onclick: () => openDrawer(name) });
  button.innerHTML = `<svg viewBox="0 0 24 24"><path d="${mark}"/></svg>`;
  button.append(title);
  $("tools").prepend(button);
  setupNav.append(h("button", { type: "button", class: "phone-only", onclick: () => openDrawer(name, true) }, title));
}

/** Add an E-stop for a board without one in reach. press(on): called with whether it is pressed. */
export function addEstop(press) {
  const estop = h("button", { type: "button", class: "estop", "aria-pressed": "false" }, "E-stop");
  estop.addEventListener("click", () => {
    const pressed = estop.getAttribute("aria-pressed") === "false";
    estop.setAttribute("aria-pressed", String(pressed));
    press(pressed);
  });
  $("tools").prepend(estop);
  return estop;
}

/** Add a tour. parts: as for Tour; on a phone it is in the menu. */
export function addTour(parts) {
  const show = (on) => {
    $("tour").hidden = !on;
    $("tour-open").setAttribute("aria-expanded", String(on));
    if (on && desk.narrow && opened) openDrawer(opened, false);
  };
  const tour = new Tour({
    device, work, operation, ...parts,
    show: (name) => {
      if (!desk.narrow) return;
      show(false);
      if (name) toPage(name);
    },
  });
  $("t-body").append(tour.element);
  $("t-close").addEventListener("click", () => show(false));
  $("tour-open").hidden = false;
  $("tour-open").addEventListener("click", () => show($("tour").hidden));
  setupNav.append(h("button", { type: "button", class: "phone-only", onclick: () => show(true) }, "Tour"));
  show(!desk.narrow);
}

/** Show a drawer, or close it if it is open. open: true: show it in any case. */
function openDrawer(name, open = opened !== name) {
  if (opened === "setup" && name !== "setup") file.hidden();
  if (!open && opened === "setup") file.hidden();
  opened = open ? name : DOCKED.matches && name !== "log" ? "log" : null;
  const wanted = opened;
  $("drawer").hidden = !wanted;
  $("drawer").classList.toggle("whole", wanted === "setup");
  $("d-close").hidden = DOCKED.matches && wanted === "log";
  for (const [each, [, element]] of Object.entries(drawers)) element.hidden = each !== wanted;
  for (const button of document.querySelectorAll("[data-drawer]")) button.setAttribute("aria-expanded", String(button.dataset.drawer === wanted));
  if (!wanted) return;
  if (desk.narrow) $("tour").hidden = true;
  setText($("d-title"), wanted === "setup" && desk.narrow ? "Menu" : drawers[wanted][0]);
  $("d-body").scrollTop = 0;
  if (wanted === "motor" && device.connected) motors.fill();
  if (wanted === "move") move.show();
  if (wanted === "log") unread(0);
  if (wanted === "setup") showPart(desk.narrow ? null : part);
}

/** Show a part of Set up; null: none, on a phone's menu. */
function showPart(name) {
  if (name !== "Rig file, load, terminal") file.hidden();
  if (name) part = name;
  for (const [each, element] of Object.entries(setup)) element.hidden = each !== name;
  for (const button of setupNav.children) {
    if (button.textContent === name) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
  setupNav.classList.toggle("away", desk.narrow && name !== null);
  if (desk.narrow) setText($("d-title"), name ?? "Menu");
}

function toSetup(name) {
  if (opened !== "setup") openDrawer("setup", true);
  showPart(name);
}

for (const button of document.querySelectorAll("[data-drawer]")) {
  button.setAttribute("aria-expanded", "false");
  button.addEventListener("click", () => openDrawer(button.dataset.drawer));
}
$("d-close").addEventListener("click", () => {
  if (opened === "setup" && desk.narrow && setupNav.classList.contains("away")) showPart(null);
  else openDrawer(opened, false);
});
DOCKED.addEventListener("change", () => openDrawer(opened ?? "log", DOCKED.matches || opened !== "log"));

// ---- the pages of a phone

function toPage(name) {
  desk.page = name;
  document.body.dataset.page = name;
  for (const button of $("pages").children) {
    if (button.dataset.page === name) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
  if (desk.narrow && opened) openDrawer(opened, false);
  timeline.redraw();
  rig.redraw();
  due();
}
for (const button of $("pages").children) button.addEventListener("click", () => toPage(button.dataset.page));
NARROW.addEventListener("change", () => {
  holds.releaseAll(); // a button that is turned away is not let go
  if (desk.narrow) $("tour").hidden = true; // it covers everything there
  due();
});

// ---- the move's line

for (const [id, only] of [["all", false], ["one", true]]) {
  $(id).addEventListener("click", () => {
    timeline.only = only;
    $("all").setAttribute("aria-pressed", String(!only));
    $("one").setAttribute("aria-pressed", String(only));
  });
}
$("undo").addEventListener("click", () => work.undo());
$("which").addEventListener("change", () => motors.choose(Number($("which").value)));
$("keyhere").addEventListener("click", () => desk.put());
$("mend").addEventListener("click", () => work.raise(work.chosen));

desk.put = () => {
  if (!$("keyhere").disabled) work.put(work.see);
};
desk.remove = () => {
  const key = work.editable && work.keys.at(work.see);
  if (key) work.change(() => work.keys.remove(key));
};

let playing = null; // {from, at}: the preview plays
desk.play = () => {
  if (playing || $("play").disabled) {
    playing = null;
    due();
    return;
  }
  const [first, end] = transport.range.slice().sort((a, b) => a - b);
  const to = transport.mode === "frames" ? work.move.endFrame : end;
  if (work.see >= to || work.see < first) work.look(transport.mode === "frames" ? work.move.startFrame : first);
  playing = { from: work.see, at: performance.now(), to };
  const turn = () => {
    if (!playing) return;
    const frame = playing.from + ((performance.now() - playing.at) / 1000) * work.fps;
    work.look(Math.min(frame, playing.to));
    if (frame >= playing.to || operation.playing) playing = null;
    due();
    if (playing) requestAnimationFrame(turn);
  };
  requestAnimationFrame(turn);
};
$("play").addEventListener("click", desk.play);

// ---- STOP

/** Keep how something has ended. What still moves then is no new motion, even if the page has not been drawn since it began. */
function ended(how) {
  last = how;
  moved = device.state.moving !== 0;
}

/** Stop everything, and note who did. */
async function stop() {
  stopper = "STOP on this page";
  playing = null;
  if (device.state.moving) ended({ kind: "stopped", title: "Stopped", text: "By STOP on this page." });
  await session.stop();
}
session.onstop = () => {
  if (!stopper) stopper = "STOP on this page";
  work.stopped();
  operation.stopped();
};
session.goesOn = () => series.goesOn;
$("stop").addEventListener("click", stop);
device.addEventListener("stopped", ({ detail }) => {
  stopper = detail.replace(/\.$/, "");
  ended({ kind: "stopped", title: "Stopped", text: detail });
});
device.addEventListener("hardstop", ({ detail }) => { stopper = detail.text ?? "the device"; });
operation.addEventListener("over", () => {
  const { early, name } = operation;
  const at = (device.state.playHead / 1000).toFixed(3);
  ended(early ? { kind: "stopped", title: "Stopped", text: `${name} at frame ${at}${stopper ? `, by: ${stopper}` : ""}. Get ready goes back to where it begins.` }
    : { kind: "over", title: "Over", text: `${name}. Get ready goes back for the next one.` });
  stopper = "";
  showTakes();
});

function showTakes() {
  takes.tBodies[0].replaceChildren(...transport.takes.map(({ take, text, good }) => h("tr", {}, h("th", { scope: "row" }, String(take)), h("td", { class: good ? "good" : "warn" }, text))));
}

// ---- the banner

const takeOver = new Twice(() => session.takeOver(), () => due(), () => device.state.moving !== 0);

let hangSeen = false; // the user knows that the watchdog has restarted the board

function sentence(text) {
  return `${text[0].toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;
}

/** Say a fault and its cure. */
function theFault(bit) {
  const { text, act = "", part: place, drawer } = CURES[bit];
  const failed = device.state.trust.flatMap((each, i) => (each.reason === DRIVER_FAILED ? [i + 1] : []));
  const what = bit === M.CONDITION_DRIVER && failed.length ? `The driver of ${device.axes.titles(failed)} does not work.` : sentence(device.conditionTexts([bit])[0]);
  const does = () => {
    if (place) toSetup(place);
    else if (drawer) openDrawer(drawer, true);
    else {
      hangSeen = true;
      due();
    }
  };
  return ["bad", "bad", "Fault", `${what} ${text}`, act, does, text];
}

/** Return [tone, mark, title, text, what the button says, what it does, short text for a phone]. */
function whole() {
  const { state } = device;
  const moving = () => session.motion.replace(/ moves?\.$/, "").replace(/\.$/, "");
  if (session.elsewhere && !device.silent) {
    const what = session.estop ? "The E-stop is held." : session.faults.length ? `Fault: ${session.faults.join("; ")}.` : state.moving ? `${session.motion} Frame ${Math.floor(state.playHead / 1000)}.` : device.connected ? "Nothing moves." : "";
    const who = sentence(session.holder).slice(0, -1);
    const [says, does] = takeOver.armed ? ["Taking over stops what moves.", "Press again"] : [what, "Take over"];
    return ["other", "other", "You watch", `${who} has the device. ${says}`, does, () => takeOver.press(), takeOver.armed ? says : `${who} has it. ${says}`];
  }
  const byHand = !session.automatic && serialIsThere();
  if (session.blind) return ["blind", "bad", device.connected ? "NO ANSWER" : "LINK LOST", `${session.blind} Whether motors move is NOT KNOWN: press the E-stop or switch their supply off.`, byHand && !device.connected ? "Connect…" : "", () => session.byCable(), "Motors may move: press the E-stop."];
  if (!device.connected) return ["none", "none", "Not connected", session.automatic ? `${session.why ? `${sentence(session.why)} ` : ""}Keyframes can be edited meanwhile.` : byHand ? "Keyframes can be edited meanwhile." : "Open the address that framestep console prints.", byHand ? "Connect…" : "", () => session.byCable()];
  if (session.estop) return ["bad", "bad", "E-STOP", `is held: nothing moves until it is released. ${device.lost.length ? `${device.lost.length} positions are lost.` : "Positions are still known."}`];
  const [fault] = session.faultBits;
  if (fault) return theFault(fault);
  if (!device.knowsWhatMoves) return ["none", "none", "Connected", ""];
  if (work.uploading !== null) return ["moves", "moves", "Getting ready", `The move goes to the board: ${Math.round(work.uploading * 100)} %. STOP ends it.`];
  if (series.goesOn) {
    const { done, count, due: next } = series.progress;
    const left = next === null ? 0 : Math.ceil((next - performance.now()) / 1000);
    return ["moves", "moves", "Time-lapse", `picture ${done + 1} of ${count}, frame ${transport.shotAt(done)}${left > 0 ? `, in ${left} s` : operation.playing ? ", exposes" : ""}. STOP ends it.`];
  }
  if (operation.going) {
    const under = Array.from({ length: device.motors }, (_, i) => i + 1).filter((motor) => device.moves(motor)).length;
    return ["moves", "moves", "Getting ready", `${operation.name}: ${under || "no"} of ${device.motors} motors ${under === 1 ? "is" : "are"} on the way to where it begins.`];
  }
  if (operation.playing) {
    const [, to] = transport.range;
    const left = transport.mode === "run" ? Math.abs(to - state.playHead / 1000) / work.fps : null;
    return ["moves", "moves", transport.mode === "run" ? `Take ${transport.take} runs` : `${operation.name} plays`, left === null ? "" : `frame ${Math.floor(state.playHead / 1000)} of ${to}, ${left.toFixed(1)} s to go${operation.loops ? " in this lap" : ""}.`];
  }
  if (operation.ready) {
    const [from, to] = transport.range;
    return ["ready", "ready", "READY", `${operation.name} is ready: GO starts it, take ${transport.take}, ${((Math.abs(to - from) + 1) / work.fps).toFixed(1)} s.`];
  }
  if (state.conditions & M.CONDITION_WATCHDOG_RESET && !hangSeen) return theFault(M.CONDITION_WATCHDOG_RESET);
  if (operation.lost) return ["warn", "warn", "Not known", operation.text];
  if (state.moving) return ["moves", "moves", `${moving()} moves`.replace(/^(.*,.*) moves$/, "$1 move"), holds.any ? `Jog at ${motors.speed} %; it ends when you let go.` : "STOP ends it."];
  const at = motors.atSwitch;
  if (at) return ["warn", "warn", "Limit switch", `${device.axes.of(at.motor).name} is at its ${at.up ? "upper" : "lower"} switch: only ${at.up ? "−" : "+"} moves it.`];
  if (last?.kind === "refused") return ["warn", "warn", "Refused", `${last.text}.`, work.misfits.length || work.refused ? "Raise the speeds" : "", () => { last = null; work.raise(); }, "See the message in the log."];
  if (last?.kind === "stopped") return ["warn", "warn", last.title, last.text];
  if (last?.kind === "over") return ["good", "good", last.title, last.text];
  const lost = device.lost;
  if (lost.length) return ["warn", "warn", "Positions not set", `${device.axes.titles(lost)}: jog to a mark, then say where it is.`, "Set positions…", () => openDrawer("positions", true), `${lost.length} motors`];
  if (state.lightsMove) return ["good", "good", "At rest", "Lights fade."];
  return ["good", "good", "At rest", work.move ? { run: `Get ready sends the rig to frame ${transport.range[0]}.`, frames: `SHOOT takes frame ${transport.range[0]}, Next frame goes on.`, lapse: "START shoots; Get ready goes to the first picture." }[transport.mode] : "Jog to a pose and press ◆ Key, or open a move."];
}

let action = null;
$("b-act").addEventListener("click", () => action?.());

function showBanner() {
  const [tone, mark, title, more = "", act = "", does = null, short = null] = whole();
  const banner = $("banner");
  if (banner.className !== tone) banner.className = tone;
  $("b-mark").setAttribute("d", MARKS[mark]);
  setText($("b-title"), title);
  const counts = tone === "moves" && (operation.playing || work.uploading !== null);
  $("b-more").setAttribute("aria-hidden", String(counts)); // a screen reader is told of states, not of frames
  setText($("b-more"), desk.narrow && short !== null ? short : more);
  if (act) setText($("b-act"), act);
  $("b-act").hidden = !act;
  action = does;
  const role = tone === "bad" || tone === "blind" ? "alert" : "status";
  if (banner.getAttribute("role") !== role) banner.setAttribute("role", role);
}

// ---- everything

let moved = false; // motors moved when the page was last drawn, or as something ended

function render() {
  const { state } = device;
  if (state.moving && !moved && !operation.busy) last = null;
  moved = state.moving !== 0;
  if (!(state.conditions & M.CONDITION_WATCHDOG_RESET)) hangSeen = false;
  document.body.classList.toggle("watch", session.elsewhere);
  document.body.classList.toggle("off", !device.connected);
  document.body.classList.toggle("stale", session.blind !== "");
  showBanner();
  motors.render();
  transport.render();
  if (opened === "camera") virtual.render();
  if (opened === "lights") outputs.render();
  if (opened === "move") move.render();
  showMove();
  setText($("moving"), session.moving);
  setText($("stop-hint"), session.elsewhere ? "works from here, too" : session.blind ? "no answer: E-stop!" : desk.narrow ? "twice: harder" : "Esc; twice: harder");
  $("stop").disabled = false;
  const texts = device.conditionTexts();
  if (conditions.dataset.texts !== texts.join("\n")) {
    conditions.dataset.texts = texts.join("\n");
    const bits = Object.keys(CONDITIONS).filter((bit) => state.conditions & bit);
    conditions.replaceChildren(...bits.map((bit) => h("li", {}, CONDITIONS[bit], CURES[bit] ? h("p", { class: "faint" }, CURES[bit].text) : null)));
  }
  for (const name of ["camera", "lights"]) drawers[name][1].inert = !desk.usable;
  motors.settings.inert = motors.positions.inert = !desk.usable;
  timeline.heads();
  rig.redraw();
}

function showMove() {
  const { move: shown, misfits } = work;
  setText($("file-name"), work.name === "keyframes" ? "Keyframes" : work.name);
  const frames = shown ? `${shown.endFrame - shown.startFrame + 1} frames` : "";
  const where = !shown ? "no move yet" : !device.connected ? "" : work.uploaded ? "uploaded" : work.onBoard ? "changed" : "not uploaded";
  setText($("file-is"), (desk.narrow ? [where] : [frames, where]).filter(Boolean).join(", "));
  const verdict = $("verdict");
  verdict.hidden = !shown;
  verdict.className = misfits.length ? "bad" : "good";
  const count = new Set(misfits.map(({ motor }) => motor)).size;
  setText(verdict, misfits.length ? `✗ ${count} ${count > 1 ? "do" : "does"} not fit` : "✓ fits");
  verdict.title = misfits.map(({ axis, text, at }) => `${axis.name}: ${text} at frame ${at}`).join("\n");
  setText($("keyhere"), `◆ Key at ${work.see}`);
  $("keyhere").disabled = !desk.usable || device.state.moving !== 0 || !work.editable;
  $("undo").disabled = !work.undoable;
  const mine = misfits.filter(({ motor, what }) => motor === work.chosen && what !== "limit");
  const mend = $("mend");
  mend.hidden = mine.length === 0 || !desk.usable || operation.busy;
  if (mine.length) setText(mend, `Raise ${mine[0].axis.name}'s speed`);
  setText($("ghost-at"), `preview, frame ${work.see}`);
  $("play-mark").setAttribute("d", playing ? PAUSES : PLAYS);
  $("play").setAttribute("aria-pressed", String(playing !== null));
  const choices = shown?.motors ?? [];
  if ([...$("which").options].map((option) => option.text).join() !== choices.map((motor) => device.axes.of(motor).title).join()) {
    $("which").replaceChildren(...choices.map((motor) => h("option", { value: String(motor) }, device.axes.of(motor).title)));
  }
  $("which").value = String(work.chosen);
}

for (const source of [device, session, operation]) source.addEventListener("change", due);
for (const name of ["change", "see", "chosen"]) work.addEventListener(name, due);
work.addEventListener("chosen", () => opened === "motor" && device.connected && motors.fill());
work.addEventListener("edited", () => { last = null; });

device.addEventListener("connected", () => {
  const { info } = device.state;
  last = null;
  setText($("who"), `${info.name}, firmware ${info.major}.${info.minor}.${info.revision}, on ${device.hello.device}`);
  $("who").title = $("who").textContent;
  byCable.hidden = true;
  for (const each of parts) each.connected?.();
  if (device.hello.example && !work.move && !work.keys.all.length) work.openKeys(device.hello.example, "the example");
  due();
});
device.addEventListener("connected", () => {
  if (!device.hello.simulated || $("tour-open").hidden === false) return;
  const { terminal } = file;
  addDrawer("repl", "REPL", terminal.element, "M4 5h16v14H4zM7 9l3 3-3 3M12 15h5");
  const estop = addEstop((on) => device.client?.ask("estop", { text: on ? "pressed" : "released" }));
  const repl = {
    get lines() { return terminal.lines; },
    enter(line) {
      openDrawer("repl", true);
      return terminal.enter(line);
    },
  };
  addTour({ estop, repl, takeExample: null });
});
device.addEventListener("gone", () => {
  setText($("who"), "Not connected");
  byCable.hidden = !serialIsThere();
});

session.addEventListener("change", () => {
  const pages = device.client?.pages ?? [];
  const text = pages.map(({ number }) => number).join();
  if (watching.dataset.pages === text) return;
  watching.dataset.pages = text;
  watching.replaceChildren(...pages.map(({ number, who }) => h("li", {}, `${who[0].toUpperCase()}${who.slice(1)} watches. `,
    twice("Hand over", "Press again: what moves stops", () => device.client?.handOver(number), () => device.state.moving !== 0))));
});

let news = 0;
function unread(count) {
  news = count;
  $("unread").hidden = count === 0;
  setText($("unread"), String(count));
}

device.addEventListener("message", ({ detail }) => {
  const time = new Date().toLocaleTimeString("en-GB");
  log.prepend(h("p", { class: detail.bad ? "bad" : "" }, h("time", {}, time), " ", h("span", {}, detail.text)));
  while (log.children.length > MESSAGES) log.lastChild.remove();
  $("said").classList.toggle("bad", detail.bad);
  setText($("said"), `${time} ${detail.text}`);
  $("said").title = detail.text;
  if (detail.bad && opened !== "log") unread(news + 1);
});

keepTheme(theme);
theme.addEventListener("change", () => rig.recolor());
document.title = `framestep console ${VERSION}`;
desk.transport = transport;
listen(desk);
toPage("take");
if (DOCKED.matches) openDrawer("log", true);

/** Connect by `open`, and repeat if that fails. null: the user connects by Web Serial. stopElsewhere: stops everything while
 * this page does not have the device. */
export function start(open, stopElsewhere = null) {
  session.start(open, stopElsewhere);
  if (!open) device.tell(serialIsThere() ? "Connect over USB to begin." : "Open the address that framestep console prints; this browser has no Web Serial.");
  render();
  return { device, work, operation, transport, drawer: openDrawer };
}
