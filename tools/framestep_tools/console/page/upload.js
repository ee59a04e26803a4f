// Uploads a move in sections as large as a frame allows, with some of them unanswered.

import { LAST_SECTION, SECTION_POSITIONS } from "./protocol.js";

const WINDOW = 4;

/** Yield the requests that upload a move, each [request, values]. */
export function* uploadRequests(move) {
  yield ["RtUploadMoveBegin", { start_frame: move.startFrame, end_frame: move.endFrame }];
  for (const [index, steps] of move.positions.entries()) {
    for (let at = 0; at < steps.length; at += SECTION_POSITIONS) {
      const last = at + SECTION_POSITIONS >= steps.length ? LAST_SECTION : 0;
      yield ["RtUploadMoveAxis", {
        motor: move.motors[index],
        start_index: at + last,
        positions: steps.slice(at, at + SECTION_POSITIONS),
      }];
    }
  }
  yield ["RtUploadMoveEnd", {}];
}

/** Upload a move, and call progress(share of 1). Throws at the first refused section, or if `ends` returns true, and sends
 * nothing after it. */
export async function upload(device, move, progress, ends) {
  const requests = [...uploadRequests(move)];
  let failed = null;
  let done = 0;
  const waiting = new Set();
  for (const [request, values] of requests) {
    const answer = device.demand(request, values).then(() => progress((done += 1) / requests.length), (error) => {
      failed ??= error;
    }).finally(() => waiting.delete(answer));
    waiting.add(answer);
    if (waiting.size >= WINDOW) await Promise.race(waiting);
    if (ends()) failed ??= new Error("it was stopped");
    if (failed) break;
  }
  await Promise.all(waiting);
  if (failed) throw failed;
}
