// The frame of a page: the link, the tabs, the stop bar, the keys. `addViews` says what it shows, `start` begins.

import { Device } from "./device.js";
import { check, h, setText, takesText } from "./dom.js";
import { Holds } from "./holds.js";
import { SerialLink, serialIsThere } from "./serial_link.js";
import { M, VERSION } from "./protocol.js";

const AGAIN_MS = 1000; // from the end of a link to the next try
const MESSAGES = 30; // kept in the log
const FAULTS = [M.CONDITION_RIG_FILE_INVALID, M.CONDITION_DRIVER, M.CONDITION_WATCHDOG_RESET];

export const device = new Device();
export const holds = new Holds();
const views = [];
const place = (id) => document.getElementById(id);
let openLink = null; // returns {link, hello}; null if the user connects by hand
let tries = true;
let shown = null;
let lost = ""; // why the device is gone
let elsewhere = false; // another page has the device
let stopElsewhere = null; // stops everything while this page does not have it
let takes = false; // take the device from another page with the next try
let onstop = () => {};
let goesOn = () => false;

// ---- the link

async function connect(open) {
  try {
    await device.connect(await open());
    return true;
  } catch (error) {
    device.tell(error.message, true);
    return false;
  }
}

/** Let the user pick a port of Web Serial, and connect to the device there. Return whether it answers. baud: the port's rate, if
 * a UART is behind it. */
export function connectByCable(baud) {
  tries = false;
  device.client?.close();
  return connect(() => SerialLink.open(baud));
}

async function serve() {
  let said = "";
  while (tries) {
    const taking = takes;
    takes = false;
    try {
      await device.connect(await openLink(taking));
      return;
    } catch (error) {
      if (error.message !== said) device.tell(error.message, true);
      said = error.message;
      isElsewhere(said);
    }
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  }
}

function isElsewhere(why) {
  elsewhere = /another page/.test(why);
  takeOver.hidden = !elsewhere;
  if (elsewhere) lost = "";
  render();
}

const byCable = h("button", {
  type: "button",
  hidden: !serialIsThere(),
  onclick: () => connectByCable(),
}, "Connect over USB…");
const takeOver = h("button", {
  type: "button",
  hidden: true,
  onclick: () => {
    takes = true;
    takeOver.hidden = true;
  },
}, "Take the device over");
place("connect").append(byCable, takeOver);

device.addEventListener("connected", () => {
  const { info } = device.state;
  setText(place("who"), `${info.name}, firmware ${info.major}.${info.minor}.${info.revision}, on ${device.hello.device}`);
  byCable.hidden = true;
  takeOver.hidden = true;
  lost = "";
  elsewhere = false;
  keep.checked = device.hello.kept;
  keepLine.hidden = !device.client.keeps;
  for (const view of views) view.connected?.();
  show(views.includes(shown) ? shown : views[0]);
});
device.addEventListener("gone", ({ detail }) => {
  holds.releaseAll();
  setText(place("who"), "Not connected");
  byCable.hidden = !serialIsThere();
  if (!detail.known) return;
  lost = "The link to the device has ended.";
  isElsewhere(detail.why);
  device.tell(elsewhere ? `${detail.why[0].toUpperCase()}${detail.why.slice(1)}.` : `The link has ended: ${detail.why}.`, true);
  if (openLink && tries && !device.restarts) setTimeout(serve, AGAIN_MS);
});

// ---- stop, and motion without this page

export async function stop() {
  holds.releaseAll();
  onstop();
  if (device.client || !stopElsewhere) {
    device.ask("MotorStopAll");
    return;
  }
  const { stop: text, bad } = await stopElsewhere();
  device.tell(text, bad);
}

place("stop").addEventListener("click", stop);
device.addEventListener("stopped", ({ detail }) => {
  holds.releaseAll();
  onstop();
  device.tell(detail, true);
});
window.addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat) return;
  event.preventDefault();
  stop();
}, { capture: true });

const keep = h("input", { onchange: () => device.client?.keep(keep.checked) });
const keepLine = check("Runs and moves go on when this page is hidden or closed", keep);
keepLine.hidden = true; // until a link can keep them going
place("keep-place").append(keepLine);

/** The page is hidden: holds have ended by themselves; stop everything else. */
function unseen() {
  if (device.client && (device.state.moving || goesOn()) && !keep.checked) stop();
}
document.addEventListener("visibilitychange", () => document.hidden && unseen());
window.addEventListener("pagehide", unseen);

// ---- present motion

/** Say what moves. */
function motion() {
  if (elsewhere) return "Another page has the device and shows what moves.";
  if (!device.connected) return "Nothing is connected.";
  if (!device.knowsWhatMoves) return "What moves is not known.";
  const moving = [];
  for (let motor = 1; motor <= device.motors; motor += 1) if (device.moves(motor)) moving.push(motor);
  const what = moving.length ? `${device.axes.titles(moving)} ${moving.length > 1 ? "move" : "moves"}` : "Nothing moves";
  return `${what}${device.state.lightsMove ? ", lights fade" : ""}.`;
}

/** Return the state of the whole: [class of the banner, text]. */
function whole() {
  const { conditions, moving } = device.state;
  if (elsewhere) return ["", "Another page has the device. STOP works from here, too."];
  if (!device.connected) return ["", "Not connected."];
  if (conditions & M.CONDITION_ESTOP) return ["bad", "The E-stop is held: nothing moves until it is released."];
  const fault = FAULTS.filter((bit) => conditions & bit);
  if (fault.length) return ["bad", `Fault: ${device.conditionTexts(fault).join("; ")}.`];
  if (!device.knowsWhatMoves) return ["", "Connected."];
  return moving ? ["moves", motion()] : ["good", "Connected. Nothing moves."];
}

function render() {
  const why = device.connected && device.silent ? "The device does not answer." : lost;
  place("lost").hidden = !why;
  setText(place("lost"), why && `${why} Whether motors move is not known: to stop them, press the E-stop or switch their supply off.`);
  const [colour, text] = whole();
  place("state").hidden = why !== "";
  place("state").className = colour;
  setText(place("state"), text);
  const head = device.knowsWhatMoves ? ` Play head ${(device.state.playHead / 1000).toFixed(3)}` : "";
  setText(place("moving"), motion() + head);
  for (const view of views) view.element.inert = (!device.connected || device.silent) && !view.worksAlone;
  const texts = device.conditionTexts();
  const list = place("conditions");
  if ([...list.children].map((item) => item.textContent).join("\n") !== texts.join("\n")) {
    list.replaceChildren(...texts.map((text) => h("li", {}, text)));
  }
  place("stop").disabled = !device.connected && !stopElsewhere;
  shown?.render();
}

let due = false;
device.addEventListener("change", () => {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    render();
  });
});

device.addEventListener("message", ({ detail }) => {
  const log = place("log");
  const time = new Date().toLocaleTimeString("en-GB");
  log.prepend(h("p", { class: detail.bad ? "bad" : "" }, h("time", {}, time), " ", h("span", {}, detail.text)));
  while (log.children.length > MESSAGES) log.lastChild.remove();
  log.scrollTop = 0;
});

// ---- views

/** Show one of the views. */
export function show(view) {
  if (shown !== view) {
    holds.releaseAll();
    shown?.hidden?.();
  }
  shown = view;
  for (const each of views) {
    each.element.hidden = each !== view;
    if (each === view) each.tab.setAttribute("aria-current", "page");
    else each.tab.removeAttribute("aria-current");
  }
  view.shown?.();
  render();
}

/** Add views, each with `title`, `element` and `render`, and show the first. title: of the page; stopped: called at each STOP;
 * going: returns whether something goes on while nothing moves, so that a hidden page has to stop it. */
export function addViews(added, title, stopped = onstop, going = goesOn) {
  for (const view of added) {
    view.tab = h("button", { type: "button", onclick: () => show(view) }, view.title);
    view.element.className = "view";
    view.element.setAttribute("aria-label", view.title);
    place("tabs").append(view.tab);
    place("views").append(view.element);
  }
  views.push(...added);
  document.title = `${title} ${VERSION}`;
  onstop = stopped;
  goesOn = going;
  show(added[0]);
}

window.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || takesText(event.target)) return;
  shown?.keydown?.(event);
});
window.addEventListener("keyup", (event) => shown?.keyup?.(event));

// ---- light and dark

const theme = place("theme");
theme.value = localStorage.getItem("theme") ?? "light dark";
const setTheme = () => {
  document.documentElement.style.colorScheme = theme.value;
  localStorage.setItem("theme", theme.value);
};
theme.addEventListener("change", setTheme);
setTheme();

/** Connect by `open`, and repeat if that fails. null: the user connects by Web Serial, and `greeting` says so.
 * stopsElsewhere: stops everything while this page does not have the device; resolves with {stop: text, bad}. */
export function start(open, greeting, stopsElsewhere = null) {
  openLink = open;
  stopElsewhere = stopsElsewhere;
  render();
  if (open) serve();
  else device.tell(greeting);
}
