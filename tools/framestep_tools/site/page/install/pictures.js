// What to do with a board's button and its drive, drawn.

import { h, s } from "framestep-console/dom.js";

function picture(label, ...parts) {
  return s("svg", { class: "picture", viewBox: "0 0 300 150", role: "img", "aria-label": label }, ...parts);
}

const arrow = (path, tip) => [s("path", { class: "arrow", d: path }), s("path", { class: "tip", d: tip })];

/** A finger on BOOTSEL, and the cable that goes in. */
function press() {
  return picture("A board with its button BOOTSEL held down while the cable is plugged in",
    s("rect", { class: "pcb", x: 90, y: 40, width: 190, height: 70, rx: 6 }),
    s("rect", { class: "metal", x: 80, y: 60, width: 30, height: 30, rx: 3 }),
    s("rect", { class: "chip", x: 200, y: 60, width: 30, height: 30, rx: 2 }),
    s("circle", { class: "button", cx: 150, cy: 75, r: 11 }),
    s("text", { x: 150, y: 138, "text-anchor": "middle" }, "hold BOOTSEL"),
    ...arrow("M150 125 V100", "M141 104 L150 90 L159 104 Z"),
    s("rect", { class: "metal", x: 40, y: 64, width: 26, height: 22, rx: 2 }),
    s("rect", { class: "plain", x: 6, y: 58, width: 34, height: 34, rx: 5 }),
    s("text", { x: 30, y: 32, "text-anchor": "middle" }, "plug in"),
    ...arrow("M12 45 H52", "M48 36 L62 45 L48 54 Z"));
}

/** A file that goes onto a drive. */
function drop(drive) {
  return picture(`The file is dragged onto the drive ${drive}`,
    s("path", { class: "plain", d: "M20 30 H62 L80 48 V110 H20 Z" }),
    s("text", { x: 50, y: 84, "text-anchor": "middle" }, ".uf2"),
    ...arrow("M95 70 H160", "M156 60 L174 70 L156 80 Z"),
    s("rect", { class: "plain", x: 185, y: 45, width: 100, height: 55, rx: 8 }),
    s("circle", { class: "tip", cx: 270, cy: 87, r: 4 }),
    s("text", { x: 235, y: 76, "text-anchor": "middle" }, drive));
}

/** Return the pictures with their captions. drive: the drive's name; byHand: the file has to be dragged onto it. */
export function pictures(drive, byHand) {
  return h("div", { class: "pictures" },
    h("figure", {}, press(), h("figcaption", {}, "Hold the button while you plug the board in, then let go.")),
    byHand ? h("figure", {}, drop(drive), h("figcaption", {}, `Drag the downloaded file onto the drive ${drive}.`)) : null);
}
