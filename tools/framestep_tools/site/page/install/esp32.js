// MicroPython's own program onto an ESP32, by Espressif's esptool-js.

import { ESPLoader, Transport } from "esptool-js";
import setup from "framestep-console/setup.json";

const CHIP_ID = 12; // in the header of an image (ESP-IDF, esp_app_format.h: esp_image_header_t)

/** The file or the board is not suitable; the message is for the user. */
export class EspError extends Error {}

/** Throw EspError if this is not all of MicroPython for a board's chip. */
function check(content, { name, chip, esp }) {
  const table = setup.esp.partitions - esp.offset;
  if (content[0] !== setup.esp.magic || setup.esp.table.some((byte, i) => content[table + i] !== byte)) {
    throw new EspError(`this is not a whole MicroPython for an ${setup.chips[chip]}: take the .bin file from its page at micropython.org/download`);
  }
  if ((content[CHIP_ID] | (content[CHIP_ID + 1] << 8)) !== esp.image) throw new EspError(`this MicroPython is not for an ${setup.chips[chip]}, which the ${name} has`);
}

/** Erase a board at a port of Web Serial and write MicroPython to it. Nothing is erased if the file or the chip is another's.
 * progress: called with the written part, 0 to 1. */
export async function write(port, board, content, progress) {
  check(content, board);
  const transport = new Transport(port, false);
  const terminal = { clean() {}, write() {}, writeLine() {} };
  const loader = new ESPLoader({ transport, baudrate: setup.esp.baud, terminal });
  try {
    await loader.main();
    const found = loader.chip.CHIP_NAME;
    if (found !== setup.chips[board.chip]) throw new EspError(`the chip on this port is an ${found}, the ${board.name} has an ${setup.chips[board.chip]}; nothing has been written`);
    await loader.writeFlash({
      fileArray: [{ data: content, address: board.esp.offset }],
      flashMode: "keep",
      flashFreq: "keep",
      flashSize: "keep",
      eraseAll: true,
      compress: true,
      reportProgress: (_, done, all) => progress(done / all),
    });
    await loader.after("hard_reset");
  } catch (error) {
    if (error instanceof EspError) throw error;
    throw new EspError(`the board does not take it (${error.message}): hold its BOOT button, press RESET, let go of BOOT, and try again`);
  } finally {
    await transport.disconnect().catch(() => {});
  }
}
