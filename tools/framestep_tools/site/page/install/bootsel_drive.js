// The drive of a board that is plugged in with BOOTSEL held, by the File System Access API.

import setup from "framestep-console/setup.json";

const CHUNK = 64 * 1024;

/** The drive is not the board's, or does not accept the image; the message is for the user. */
export class DriveError extends Error {}

export const canChoose = () => "showDirectoryPicker" in window;

/** Return the names that the drives of a chip's boards have. */
export function driveOf(chip) {
  return Object.keys(setup.chipOf).find((name) => setup.chipOf[name] === chip);
}

/** Let the user choose a board's drive. Null if nothing is chosen. Throws DriveError if it is not the drive of such a board. */
export async function choose(board) {
  let folder;
  try {
    folder = await window.showDirectoryPicker({ id: "bootsel", mode: "readwrite" });
  } catch (error) {
    if (error.name === "AbortError") return null;
    throw new DriveError(`the browser does not open this drive (${error.message}): download the file instead`);
  }
  const about = await read(folder);
  if (about === null) throw new DriveError(`the folder ${folder.name} is not a board's drive, as it has no ${setup.about}: choose the drive ${driveOf(board.chip)}`);
  const [, found] = /^Board-ID:\s*(\S+)/m.exec(about) ?? [];
  const chip = setup.chipOf[found];
  if (!chip) throw new DriveError(`the drive ${folder.name} is of a board that framestep does not know (${found ?? `no Board-ID in ${setup.about}`}); nothing has been written`);
  if (chip !== board.chip) throw new DriveError(`the board on ${folder.name} has an ${setup.chips[chip]}, ${board.name} an ${setup.chips[board.chip]}: choose another board above, or plug the right one in; nothing has been written`);
  return folder;
}

/** Return the text of the drive's own file; null if there is none, because the board has left, or it is another drive. */
async function read(folder) {
  try {
    return await (await (await folder.getFileHandle(setup.about)).getFile()).text();
  } catch {
    return null;
  }
}

/** Write an image onto a chosen drive; then the board restarts and the drive disappears. progress: called with the bytes written. */
export async function write(folder, name, content, progress) {
  let done = 0;
  try {
    const file = await folder.getFileHandle(name, { create: true });
    const stream = await file.createWritable();
    while (done < content.byteLength) {
      const piece = content.slice(done, done + CHUNK);
      await stream.write(piece);
      done += piece.byteLength;
      progress(done);
    }
    await stream.close();
  } catch (error) {
    // The board restarts with the last block, often before the browser has closed the file
    if (done < content.byteLength - CHUNK || (await read(folder)) !== null) {
      throw new DriveError(`${name} cannot be written onto ${folder.name} (${error.message}): download the file and drag it onto the drive`);
    }
  }
}
