// The page that puts framestep onto a board, step by step, up to its first move.

import "framestep-console/frame.css";
import "./install/install.css";
import { addViews, connectByCable, device, holds, show, start } from "framestep-console/frame.js";
import { serialIsThere } from "framestep-console/serial_link.js";
import { BoardStep } from "./install/board_step.js";
import { ConnectStep } from "./install/connect_step.js";
import { FirstMoveStep } from "./install/first_move_step.js";
import { MotorsStep } from "./install/motors_step.js";
import { RigStep } from "./install/rig_step.js";

const board = new BoardStep();
const rig = new RigStep(device, () => board.board, () => show(motors));
const swap = async (motor) => {
  await rig.invert(motor);
  show(rig);
};
const connect = new ConnectStep(device, () => board.board, () => connectByCable(board.baud), () => rig.read(), () => show(rig));
const first = new FirstMoveStep(device);
const motors = new MotorsStep(device, holds, swap, () => show(first));
addViews([board, connect, rig, motors, first], "Install framestep");
start(serialIsThere() ? "Choose your board." : "This browser has no Web Serial. It can fetch the image; to set the board up, take Chrome or Edge on a computer.");
