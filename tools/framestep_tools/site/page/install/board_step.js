// Step 1: which board it is, and its image onto the board's drive.

import { h, setText } from "framestep-console/dom.js";
import setup from "framestep-console/setup.json";
import { canChoose, choose, DriveError, driveOf, fetchImage, write } from "./bootsel_drive.js";
import { pictures } from "./pictures.js";

const bySelf = (name) => `framestep install --board ${name}`;

export class BoardStep {
  title = "1. Board";
  worksAlone = true;
  element = h("section");
  /** The chosen board's entry in setup.json. */
  board = setup.boards.find(({ image }) => image) ?? setup.boards[0];
  #image = h("article", { class: "card", "aria-label": "Its image" });
  #onchoice;

  /** onchoice: called when another board is chosen. */
  constructor(onchoice = () => {}) {
    this.#onchoice = onchoice;
    const choices = setup.boards.map((board) => h("label", {},
      h("input", { type: "radio", name: "board", value: board.board, checked: board === this.board, disabled: board.unfit !== null, onchange: () => this.#choose(board) }),
      board.name,
      h("small", {}, board.unfit ?? `${setup.chips[board.chip]}, ${board.motors} motors`)));
    this.element.append(
      h("article", { class: "card", "aria-label": "Your board" }, h("h2", {}, "Which board do you have?"),
        h("div", { class: "boards", role: "radiogroup", "aria-label": "Board" }, ...choices),
        h("p", { class: "faint" }, "No board has been tried on hardware yet: begin with the motors' supply switched off.")),
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
    this.#image.replaceChildren(h("h2", {}, `framestep onto the ${board.name}`), ...(board.hasImage ? this.#withImage(board) : [
      h("p", {}, "An ESP32 needs MicroPython first, then framestep's files. With the package of framestep and Python, ", h("code", {}, `${bySelf(board.board)} --micropython FILE.bin`), " does both."),
    ]));
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

  async #save(button, bar, said) {
    const { board } = this;
    button.disabled = true;
    said.className = "";
    try {
      setText(said, "");
      const folder = await choose(board);
      if (!folder) return;
      const content = await fetchImage(board.image);
      bar.hidden = false;
      setText(said, `Writing onto ${folder.name} …`);
      await write(folder, board.image.file, content, (done) => {
        bar.value = done;
      });
      said.className = "known";
      setText(said, "The image is on the board, which starts with it.");
    } catch (error) {
      if (!(error instanceof DriveError)) throw error;
      said.className = "lost";
      setText(said, `${error.message[0].toUpperCase()}${error.message.slice(1)}.`);
    } finally {
      bar.hidden = true;
      button.disabled = false;
    }
  }
}
