// What to do about a fault that the board reports.

import { M } from "./protocol.js";

/** A fault's cure, by its bit; `part` of Set up and the drawer that help. */
export const CURES = {
  [M.CONDITION_RIG_FILE_INVALID]: { text: "Read it in Set up, mend what is wrong, put it back.", act: "Rig file…", part: "Rig file, load, terminal" },
  [M.CONDITION_CLOCK]: { text: "Press the board's reset button, or switch it off and on." },
  [M.CONDITION_DRIVER]: { text: "Let it cool, check the motors' supply and the driver's cable. It comes back by itself; then set the position.", act: "Positions…", drawer: "positions" },
  [M.CONDITION_WATCHDOG_RESET]: { text: "Set the positions again, and report it, with what the board did.", act: "Seen" },
};

/** Faults that keep motors from moving, the worst first. */
export const FAULTS = [M.CONDITION_RIG_FILE_INVALID, M.CONDITION_CLOCK, M.CONDITION_DRIVER];
