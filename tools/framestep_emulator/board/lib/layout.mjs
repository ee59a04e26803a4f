// Where the parts of a board are in the memory of its code (native.mjs), and constants that both share.

export const PAGE = 65536;
export const FLASH_SIZE = 2 * 1024 * 1024;
export const RAM_SIZE = 264 * 1024;
export const FLASH_BASE = 0x10000000;
export const RAM_BASE = 0x20000000;

// Addresses in the memory. Entries: a word for each halfword of code: the number of the piece that begins there, or minus the number of branches
// to it so far.
export const AT = {
  registers: 0,
  state: 0x40, // STATE of m0.mjs
  xipTags: 0x1000,
  xipOld: 0x3000,
  ram: PAGE,
  ramEntries: 6 * PAGE,
  flash: 0x100000,
  flashEntries: 0x300000,
  xipPresent: 0x700000, // for each line of 8 bytes: 0, or 1 or 2 if it is in the first or second half of the cache
};
export const XIP_LINES = 0x200000;
export const MEMORY_SIZE = AT.xipPresent + XIP_LINES;
