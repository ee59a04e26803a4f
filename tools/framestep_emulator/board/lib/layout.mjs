// Where the parts of a board are in the memory of its translated code (native.mjs), and constants that both share.

export const PAGE = 65536;
export const FLASH_SIZE = 2 * 1024 * 1024;
export const RAM_SIZE = 264 * 1024;
export const FLASH_BASE = 0x10000000;
export const RAM_BASE = 0x20000000;

// Addresses in the memory. ENTRIES: a word for each halfword of code. More than 0: a function and where it begins there
// (function << 8 | leader). Else minus the number of branches to it.
export const AT = {
  registers: 0,
  cycles: 0x58, // of the stretch, plus BIAS; the next word is added to at the same time
  xipAccesses: 0x5c,
  xipMisses: 0x60,
  limit: 0x84, // plus BIAS
  nz: 0x88,
  c: 0x8c,
  v: 0x90,
  line: 0x94, // of the flash, fetched last
  left: 0x98, // why the translated code has stopped, see LEFT
  missCost: 0x9c,
  pc: 0xa0, // where an end of translated code leads, if the end's own word for it is 0
  xipTags: 0x1000,
  xipOld: 0x3000,
  ram: PAGE,
  ramEntries: 6 * PAGE,
  flash: 0x100000,
  flashEntries: 0x300000,
  xipPresent: 0x700000, // for each line of 8 bytes: 0, or 1 or 2 if it is in the first or second half of the cache
  flashSeen: 0x900000, // for each halfword: 1 once it has been interpreted
  ramSeen: 0xa00000,
  // ENDS pieces of 32 bytes, which the ends of translated code name: cycles and fetched lines of the block (as AT.cycles),
  // its last line or -1, LEFT, the address at which it goes on
  ends: 0xa80000,
};
export const XIP_LINES = 0x200000;
export const ENDS = 0x10000;
export const MEMORY_SIZE = AT.ends + 32 * ENDS;
export const WORD = { cycles: 0x16, limit: 0x21, nz: 0x22, c: 0x23, v: 0x24, line: 0x25, left: 0x26, missCost: 0x27 }; // of AT
export const BIAS = 0x10000; // so that the cycles are never less than 0

// Values of AT.left
export const LEFT = {
  jump: 0, // to code that has not been translated
  bail: 1, // the interpreter does the next instruction
  force: 2, // the same, also at the limit: its fetch has begun
  stale: 3, // the code in RAM is another one now
};
