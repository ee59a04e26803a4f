// UF2: the file that is dropped onto a board's drive, in 512-byte blocks with addresses in flash.

const BLOCK = 512;
const MAGIC = 0x0a324655;
const FLASH = 0x10000000;
const CHIPS = new Map([[0xe48bff56, 'RP2040'], [0xe48bff59, 'RP2350']]); // by their families

/** {chip, firmware}: the chip that a file is for, and the flash's content from its start. */
export function imageOf(file) {
  const view = new DataView(file.buffer, file.byteOffset, file.length);
  const blocks = [];
  let chip;
  for (let at = 0; at + BLOCK <= file.length; at += BLOCK) {
    const word = (i) => view.getUint32(at + 4 * i, true);
    if (word(0) !== MAGIC) continue;
    chip ??= CHIPS.get(word(7));
    if (chip && CHIPS.get(word(7)) === chip) blocks.push({ from: word(3) - FLASH, data: file.subarray(at + 32, at + 32 + word(4)) });
  }
  if (!blocks.length) throw new Error('this is no UF2 file for an RP2040 or RP2350');
  const flash = new Uint8Array(Math.max(...blocks.map(({ from, data }) => from + data.length))).fill(0xff);
  for (const { from, data } of blocks) flash.set(data, from);
  return { chip, firmware: flash };
}
