// The page that puts framestep onto a board, step by step.

import "framestep-console/style.css";
import "./install/install.css";
import { addViews, start } from "framestep-console/frame.js";
import { serialIsThere } from "framestep-console/serial_link.js";
import { BoardStep } from "./install/board_step.js";

addViews([new BoardStep()], "Install framestep");
start(null, serialIsThere() ? "Choose your board." : "This browser has no Web Serial. It can fetch the image; to set the board up, take Chrome or Edge on a computer.");
