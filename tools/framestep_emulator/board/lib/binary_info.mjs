// Facts that a firmware states about itself, near the start of the flash: pico-sdk's "binary info", and the block for an
// RP2350's boot ROM.

const FLASH = 0x10000000;
const START = 0x7188ebf2;
const END = 0xe71aa390;
const WITHIN = 0x1000; // the two markers are within this many bytes from the start of the flash
const BLOCK_DEVICE = 7;
const BLOCK_MARKER = 0xffffded3; // RP2350 datasheet, 5.9.5

/** Name of the chip that an image is for. */
export function chipOf(firmware) {
  const view = new DataView(firmware.buffer, firmware.byteOffset, firmware.byteLength);
  for (let at = 0; at + 4 <= Math.min(WITHIN, view.byteLength); at += 4) {
    if (view.getUint32(at, true) === BLOCK_MARKER) return 'RP2350';
  }
  return 'RP2040';
}

/** Offset and size of MicroPython's file system in flash; null for other firmware. */
export function fileSystem(firmware) {
  const view = new DataView(firmware.buffer, firmware.byteOffset, firmware.byteLength);
  const word = (at) => view.getUint32(at, true);
  for (let at = 0; at + 20 <= Math.min(WITHIN, view.byteLength); at += 4) {
    if (word(at) !== START || word(at + 16) !== END) continue;
    for (let entry = word(at + 4) - FLASH; entry < word(at + 8) - FLASH; entry += 4) {
      const info = word(entry) - FLASH;
      if (view.getUint16(info, true) !== BLOCK_DEVICE) continue;
      const name = word(info + 4) - FLASH;
      const text = new TextDecoder().decode(firmware.subarray(name, firmware.indexOf(0, name)));
      if (text === 'MicroPython') return { offset: word(info + 8) - FLASH, size: word(info + 12) };
    }
  }
  return null;
}
