// The frame of a page of views: tabs, the stop bar, the keys. `addViews` says what it shows, `start` begins.

import { h, setText, takesText } from "./dom.js";
import { device, holds, session } from "./session.js";
import { serialIsThere } from "./serial_link.js";
import { keepTheme } from "./theme.js";
import { VERSION } from "./protocol.js";

export { device, holds };

const MESSAGES = 30; // kept in the log

const views = [];
const place = (id) => document.getElementById(id);
let shown = null;

/** Let the user pick a port of Web Serial. Return whether a device answers. baud: the port's rate, if a UART is behind it. */
export function connectByCable(baud) {
  return session.byCable(baud);
}

const byCable = h("button", {
  type: "button",
  hidden: !serialIsThere(),
  onclick: () => connectByCable(),
}, "Connect over USB…");
place("connect").append(byCable);

device.addEventListener("connected", () => {
  const { info } = device.state;
  setText(place("who"), `${info.name}, firmware ${info.major}.${info.minor}.${info.revision}, on ${device.hello.device}`);
  byCable.hidden = true;
  for (const view of views) view.connected?.();
  show(views.includes(shown) ? shown : views[0]);
});
device.addEventListener("gone", () => {
  setText(place("who"), "Not connected");
  byCable.hidden = !serialIsThere();
});

place("stop").addEventListener("click", () => session.stop());
place("keep-place").append(session.keepLine);

// ---- the state of the whole

/** Return the state of the whole: [class of the banner, text]. */
function whole() {
  if (!device.connected) return ["", "Not connected."];
  if (session.estop) return ["bad", "The E-stop is held: nothing moves until it is released."];
  if (session.faults.length) return ["bad", `Fault: ${session.faults.join("; ")}.`];
  if (!device.knowsWhatMoves) return ["", "Connected."];
  return device.state.moving ? ["moves", session.motion] : ["good", "Connected. Nothing moves."];
}

function render() {
  const why = session.blind;
  place("lost").hidden = !why;
  setText(place("lost"), why && `${why} Whether motors move is not known: to stop them, press the E-stop or switch their supply off.`);
  const [colour, text] = whole();
  place("state").hidden = why !== "";
  place("state").className = colour;
  setText(place("state"), text);
  setText(place("moving"), session.moving);
  for (const view of views) view.element.inert = (!device.connected || device.silent) && !view.worksAlone;
  const texts = device.conditionTexts();
  const list = place("conditions");
  if ([...list.children].map((item) => item.textContent).join("\n") !== texts.join("\n")) {
    list.replaceChildren(...texts.map((text) => h("li", {}, text)));
  }
  place("stop").disabled = !session.canStop;
  shown?.render();
}

let due = false;
for (const source of [device, session]) {
  source.addEventListener("change", () => {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      render();
    });
  });
}

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

/** Add views, each with `title`, `element` and `render`, and show the first. title: of the page. */
export function addViews(added, title) {
  for (const view of added) {
    view.tab = h("button", { type: "button", onclick: () => show(view) }, view.title);
    view.element.className = "view";
    view.element.setAttribute("aria-label", view.title);
    place("tabs").append(view.tab);
    place("views").append(view.element);
  }
  views.push(...added);
  document.title = `${title} ${VERSION}`;
  show(added[0]);
}

window.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || takesText(event.target)) return;
  shown?.keydown?.(event);
});
window.addEventListener("keyup", (event) => shown?.keyup?.(event));

keepTheme(place("theme"));

/** Begin: the user connects by Web Serial, and `greeting` says so. */
export function start(greeting) {
  session.start(null);
  render();
  device.tell(greeting);
}
