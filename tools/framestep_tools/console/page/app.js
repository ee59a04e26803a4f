// The console: its views in the frame. `start` begins.

import { addViews, device, holds, show, start as begin, stop } from "./frame.js";
import { Operation } from "./operation.js";
import { Series } from "./series.js";
import { serialIsThere } from "./serial_link.js";
import { AxesView } from "./views/axes.js";
import { KeyframesView } from "./views/keyframes.js";
import { MotorsView } from "./views/motors.js";
import { MovesView } from "./views/moves.js";
import { OutputsView } from "./views/outputs.js";
import { RigView } from "./views/rig.js";
import { ShootView } from "./views/shoot.js";
import { VirtualView } from "./views/virtual.js";

const operation = new Operation(device);
const series = new Series(device, operation);
const moves = new MovesView(device, holds, operation);
addViews([
  new MotorsView(device, holds, stop),
  moves,
  new KeyframesView(device, (...move) => {
    moves.take(...move);
    show(moves);
  }),
  new ShootView(device, operation, series),
  new OutputsView(device),
  new VirtualView(device, holds, moves),
  new AxesView(device),
  new RigView(device),
], "framestep console", () => operation.stopped(), () => series.goesOn);

/** Connect by `open`, and repeat if that fails. null: the user connects by Web Serial. stopElsewhere: stops everything while
 * this page does not have the device. */
export function start(open, stopElsewhere = null) {
  begin(open, serialIsThere() ? "Connect over USB to begin." : "Open the address that framestep console prints; this browser has no Web Serial.", stopElsewhere);
  return { device, moves, operation };
}
