// Step 1: which board it is, and its image onto the board's drive.

import { field, h, setText } from "framestep-console/dom.js";
import setup from "framestep-console/setup.json";
import { LinkError } from "framestep-console/client.js";
import { choosePort, serialIsThere } from "framestep-console/serial_link.js";
import { put } from "./board_files.js";
import { canChoose, choose, DriveError, driveOf, write } from "./bootsel_drive.js";
import { EspError, write as writeMicroPython } from "./esp32.js";
import { fetchFile, FileError } from "./next_to_page.js";
import { pictures } from "./pictures.js";

// Boards with the same chip have the same drive and the same ports, so none is chosen beforehand: the image of another one steps other pins.
const NOT_CHOSEN = { name: "board", motors: Math.max(...setup.boards.map(({ motors }) => motors)), ports: 2, foreground: false, example: null };
const FOR_THE_USER = [DriveError, EspError, FileError, LinkError];

export class BoardStep {
  title = "1. Board";
  worksAlone = true;
  element = h("section");
  /** The chosen board's entry in setup.json, or what holds for one that is not known. */
  board = NOT_CHOSEN;
  /** The rate of the board's port, if it has a UART. */
  baud = setup.rates[0];
  #image = h("article", { class: "card", "aria-label": "Its image" });
  #onchoice;

  /** onchoice: called when another board is chosen. */
  constructor(onchoice = () => {}) {
    this.#onchoice = onchoice;
    const choices = setup.boards.map((board) => h("label", {},
      h("input", { type: "radio", name: "board", value: board.board, onchange: () => this.#choose(board) }),
      board.name,
      h("small", {}, `Printed on it: ${board.printed}. ${setup.chips[board.chip]}, ${board.motors} motors`)));
    this.element.append(
      h("article", { class: "card", "aria-label": "Your board" }, h("h2", {}, "What is printed on your board?"),
        h("p", {}, "Read it on the board itself, not on its drive: boards with the same chip show the same drive, and another board's image would step other pins."),
        h("div", { class: "boards", role: "radiogroup", "aria-label": "Board" }, ...choices),
        h("p", { class: "faint" }, "No board has been tried on hardware yet: begin with the motors' supply switched off. ",
          h("a", { href: "licences.txt" }, "Licences"), " of the packages that this page is made of.")),
      this.#image);
    this.#show();
  }

  render() {}

  #choose(board) {
    this.board = board;
    this.#show();
    this.#onchoice();
  }

  #show() {
    const { board } = this;
    this.#image.hidden = board === NOT_CHOSEN;
    if (board === NOT_CHOSEN) return;
    this.#image.replaceChildren(h("h2", {}, `framestep onto the ${board.name}`), ...(board.hasImage ? this.#withImage(board) : this.#withFiles(board)));
  }

  #withImage({ board, chip, image }) {
    if (!image) {
      return [h("p", {}, "This page was built without the image for this board. Take it from a release, or build it in a clone: ",
        h("code", {}, `make image BOARD=${board}`), ", then the page again.")];
    }
    const said = h("p", { role: "status" });
    const bar = h("progress", { max: image.size, value: 0, hidden: true, "aria-label": "Written" });
    const save = h("button", { type: "button", class: "main", onclick: () => this.#save(save, bar, said) }, "Save it onto the drive…");
    const link = h("a", { class: canChoose() ? "button" : "button main", href: image.file, download: image.file }, `Download ${image.file}`);
    const drive = driveOf(chip);
    return [
      pictures(drive, !canChoose()),
      h("ol", { class: "what" },
        h("li", {}, `${setup.press[0].toUpperCase()}${setup.press.slice(1)}. Here it is ${drive}.`),
        canChoose()
          ? h("li", {}, `Save the image: the browser asks for a folder. Choose the drive ${drive} and allow writing. `, h("div", { class: "row" }, save, link), bar, said)
          : h("li", {}, "Download the image: ", h("div", { class: "row" }, link)),
        h("li", {}, canChoose() ? "The drive disappears, and the board starts with framestep." : `Drag it onto the drive ${drive}. The drive disappears, and the board starts with framestep.`)),
      h("p", { class: "faint" }, `${Math.round(image.size / 1024)} kB: MicroPython with framestep in it. Your rig.json and other files on the board stay. SHA-256: `, h("code", { class: "sum" }, image.sha256)),
    ];
  }

  #withFiles({ board, chip, files }) {
    const byHand = h("p", { class: "faint" }, "With Python and framestep's package, ", h("code", {}, `framestep install --board ${board} --micropython FILE.bin`), " does both.");
    if (!serialIsThere()) return [h("p", {}, "An ESP32 gets MicroPython and framestep's files by Web Serial, which this browser does not have: take Chrome or Edge on a computer."), byHand];
    if (!files) return [h("p", {}, "This page was built without the files for this board."), byHand];
    const file = h("input", { type: "file", accept: ".bin" });
    const [saidFirst, saidThen] = [h("p", { role: "status" }), h("p", { role: "status" })];
    const bar = h("progress", { max: 1, value: 0, hidden: true, "aria-label": "Written" });
    const rate = h("select", { onchange: () => {
      this.baud = Number(rate.value);
    } }, ...setup.rates.map((baud) => h("option", { value: baud, selected: baud === this.baud }, String(baud))));
    const first = h("button", { type: "button", onclick: () => this.#writeMicroPython(first, file, bar, saidFirst) }, "Erase the board and write it…");
    const then = h("button", { type: "button", class: "main", onclick: () => this.#putFiles(then, saidThen) }, "Put framestep's files onto it…");
    return [
      h("ol", { class: "what" },
        h("li", {}, `MicroPython for an ${setup.chips[chip]}, ${setup.files.oldest.join(".")} or newer: the .bin file from micropython.org/download. Skip this if the board has it. Writing erases everything on the board. `,
          field("MicroPython's .bin file", file), h("div", { class: "row" }, first), bar, saidFirst),
        h("li", {}, "framestep's files. If framestep runs already, it ends and starts again, so nothing may move. rig.json and your other files stay. ",
          field("Rate of its port, if its rig.json sets uart_baud", rate), h("div", { class: "row" }, then), saidThen)),
      byHand,
    ];
  }

  #writeMicroPython(button, file, bar, said) {
    const { board } = this;
    return this.#work(button, bar, said, async () => {
      if (file.files.length === 0) throw new FileError("choose MicroPython's .bin file first");
      const port = await choosePort();
      const content = new Uint8Array(await file.files[0].arrayBuffer());
      bar.value = 0;
      bar.hidden = false;
      setText(said, "Reaching the chip, then erasing and writing. This takes a minute or two …");
      await writeMicroPython(port, board, content, (part) => {
        bar.value = part;
      });
      return "MicroPython is on the board, which starts with it. Next: framestep's files.";
    });
  }

  #putFiles(button, said) {
    const { board } = this;
    return this.#work(button, null, said, async () => {
      const port = await choosePort();
      const files = JSON.parse(new TextDecoder().decode(await fetchFile(board.files)));
      const count = await put(port, board, files, (text) => setText(said, text), this.baud);
      return count ? `framestep is on the board (${count} files written), which restarts with it.` : "All of framestep was on the board already; it restarts.";
    });
  }

  #save(button, bar, said) {
    const { board } = this;
    return this.#work(button, bar, said, async () => {
      const folder = await choose(board);
      if (!folder) return "";
      const content = await fetchFile(board.image);
      bar.hidden = false;
      setText(said, `Writing onto ${folder.name} …`);
      await write(folder, board.image.file, content, (done) => {
        bar.value = done;
      });
      return "The image is on the board, which starts with it.";
    });
  }

  /** Run work that a button begins and that returns a sentence; a reason why it failed is shown. */
  async #work(button, bar, said, work) {
    button.disabled = true;
    said.className = "";
    setText(said, "");
    try {
      const done = await work();
      said.className = "known";
      setText(said, done);
    } catch (error) {
      if (!FOR_THE_USER.some((kind) => error instanceof kind)) throw error;
      said.className = "lost";
      setText(said, `${error.message[0].toUpperCase()}${error.message.slice(1)}.`);
    } finally {
      if (bar) bar.hidden = true;
      button.disabled = false;
    }
  }
}
