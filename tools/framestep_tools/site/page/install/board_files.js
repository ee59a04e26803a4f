// framestep's files into the file system of a board with MicroPython, through its raw REPL. The list of them is removed
// before any of them changes, and written last: whatever interrupts the work, the board finds all files or no list.

import { LinkError } from "framestep-console/client.js";
import { SCRIPTS } from "framestep-console/protocol.js";
import { Repl } from "framestep-console/repl.js";
import setup from "framestep-console/setup.json";
import { digest } from "./next_to_page.js";

const { list, main, oldest, ownPortFrom, scripts } = setup.files;
const MARK = "\x02";
const CHUNK = 768; // bytes of a file in one script
const TRIES = 4; // while MicroPython starts and formats the flash

const older = (version, than) => version[0] < than[0] || (version[0] === than[0] && version[1] < than[1]);

async function lines(repl, script) {
  const said = (await repl.run(script)).split(MARK).at(-1);
  return said.split(/\r?\n/).filter((line) => line.trim()).map((line) => JSON.parse(line));
}

/** Put files, {path: base64}, onto a board at a port of Web Serial, and restart it. Returns the number of files written.
 * say: called with a sentence before each step; baud: the port's rate while framestep runs. Throws LinkError. */
export async function put(port, board, files, say, baud) {
  say("Reaching MicroPython …");
  const repl = await open(port, baud);
  let restarts = false;
  try {
    await check(repl, board);
    if ((await lines(repl, SCRIPTS.halt))[0] !== 0) throw new LinkError("motors move, or a run is prepared; nothing has been changed");
    restarts = true;
    return await bring(repl, files, say);
  } finally {
    if (restarts) {
      say("Restarting …");
      await repl.runAndLeave(SCRIPTS.restart).catch(() => {});
    }
    await repl.close();
  }
}

async function open(port, baud) {
  for (let i = 1; ; i += 1) {
    try {
      return await Repl.open(port, i % 2 ? baud : undefined); // without framestep it has the usual rate
    } catch (error) {
      if (i === TRIES) throw error;
    }
  }
}

/** Throw LinkError if the board's MicroPython cannot run the files, or if it has another main.py. */
async function check(repl, board) {
  const [[version, arch, machine]] = await lines(repl, scripts.who);
  if (older(version, oldest)) {
    throw new LinkError(`the board has MicroPython ${version.join(".")}, framestep needs ${oldest.join(".")} or newer: write a newer one first`);
  }
  const chip = machine.split(" with ").at(-1);
  if (arch !== board.arch || chip !== setup.chips[board.chip].replaceAll("-", "")) throw new LinkError(`the board is a ${machine}, but the ${board.name} has an ${setup.chips[board.chip]}: choose the right board`);
  if (board.ports === 2 && older(version, ownPortFrom)) throw new LinkError(`with MicroPython ${version.join(".")} the ${board.name} has no port of its own for Dragonframe: write ${ownPortFrom.join(".")} or newer first`);
  if ((await lines(repl, scripts.otherMain))[0]) throw new LinkError(`the board has a ${main} of its own, which would run instead of framestep: save it and remove it first`);
}

async function bring(repl, files, say) {
  const contents = new Map(Object.entries(files).map(([path, text]) => [path, Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]));
  const sums = new Map();
  for (const [path, content] of contents) sums.set(path, await digest(content));
  const there = await lines(repl, scripts.list);
  await repl.run(scripts.digest);
  const changed = [];
  for (const [path, sum] of sums) if ((await sumOf(repl, path)) !== sum) changed.push(path);
  const stale = there.filter((path) => !contents.has(path));
  if (changed.length === 0 && stale.length === 0) return 0;
  await repl.run(scripts.write);
  for (const path of [list, ...stale]) if (there.includes(path)) await repl.run(`os.remove(${JSON.stringify(path)})`);
  const order = [...changed.filter((path) => path !== list), list];
  for (const [i, path] of order.entries()) {
    say(`Copying ${i + 1}/${order.length} ${path}`);
    await write(repl, path, contents.get(path), sums.get(path));
  }
  return order.length;
}

async function sumOf(repl, path) {
  return (await lines(repl, `print("\\x02")\ndigest(${JSON.stringify(path)})`))[0];
}

/** Write a file beside the old one, compare it, and put it into its place. */
async function write(repl, path, content, sum) {
  for (let at = path.indexOf("/", 1); at > 0; at = path.indexOf("/", at + 1)) await repl.run(`folder(${JSON.stringify(path.slice(0, at))})`);
  const fresh = JSON.stringify(`${path}.new`);
  await repl.run(`f = open(${fresh}, "wb")`);
  for (let at = 0; at < content.length; at += CHUNK) {
    const text = btoa(String.fromCharCode(...content.subarray(at, at + CHUNK)));
    await repl.run(`w("${text}")`);
  }
  await repl.run("f.close()");
  if ((await sumOf(repl, `${path}.new`)) !== sum) throw new LinkError(`${path} did not arrive as sent; try again, perhaps with another cable`);
  await repl.run(`os.rename(${fresh}, ${JSON.stringify(path)})`);
}
