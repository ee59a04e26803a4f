// A replacement of the boot ROM: an image generated here with the RP2040's public layout (magic,
// version, function and data tables), whose entries are `bkpt #n; bx lr`. `BootRom.call` services
// the breakpoints in JavaScript, and charges the cycles that the real function would take.

import { DOUBLE_TABLE, FLOAT_TABLE } from './softfloat.mjs';

const ROM_BYTES = 16 * 1024;
const ROM_VERSION = 3; // of RP2040 B2, the silicon on today's boards
const BOOT2_RAM = 0x20041f00;
const BOOT2_SIZE = 256;
const XIP_BASE = 0x10000000;
const SECTOR = 4096;
const REBOOT_MAGIC = 0xb007c0d3;

const BX_LR = 0x4770;
const BKPT = 0xbe00;

const code = (text) => text.charCodeAt(0) | (text.charCodeAt(1) << 8);

/** CRC-32 without reflection, as the ROM computes it over the first 252 bytes of flash. */
function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte << 24;
    for (let i = 0; i < 8; i++) crc = crc & 0x80000000 ? (crc << 1) ^ 0x04c11db7 : crc << 1;
  }
  return crc >>> 0;
}

export class BootRom {
  /**
   * @param machine the parts that the ROM acts on: machine.chip, machine.flash (Uint8Array)
   * @param timing.eraseMs time to erase one 4 KB sector
   * @param timing.erase64Ms time to erase a 64 KB block at once
   * @param timing.programMs time to program one 256-byte page
   */
  constructor(machine, { eraseMs = 45, erase64Ms = 150, programMs = 0.4 } = {}) {
    this.machine = machine;
    this.timing = { eraseMs, erase64Ms, programMs };
    this.services = [];
    this.image = new Uint8Array(ROM_BYTES);
    this.view = new DataView(this.image.buffer);
    this.build();
  }

  // ------------------------------------------------------------------ the image

  build() {
    const { view } = this;
    let here = 0x100;
    const entry = (service) => {
      const address = here;
      view.setUint16(here, BKPT | this.services.length, true);
      view.setUint16(here + 2, BX_LR, true);
      this.services.push(service);
      here += 4;
      return address | 1;
    };

    const boot = entry((core) => this.boot(core));
    const unexpected = entry((core) => core.halt(`exception ${core.IPSR} with the ROM's vector table`));
    const lookup = entry((core) => this.lookup(core));
    const functions = {
      P3: entry((core) => this.bits(core, (x) => popcount(x), 20)),
      R3: entry((core) => this.bits(core, (x) => reverse(x), 22)),
      L3: entry((core) => this.bits(core, (x) => Math.clz32(x), 10)),
      T3: entry((core) => this.bits(core, (x) => (x ? 31 - Math.clz32(x & -x) : 32), 11)),
      MS: entry((core) => this.memset(core, false)),
      S4: entry((core) => this.memset(core, true)),
      MC: entry((core) => this.memcpy(core, false)),
      C4: entry((core) => this.memcpy(core, true)),
      UB: entry((core) => this.usbBoot(core)),
      IF: entry(() => {}),
      EX: entry((core) => this.exitXip(core)),
      RE: entry((core) => this.erase(core)),
      RP: entry((core) => this.program(core)),
      FC: entry((core) => this.flushCache(core)),
      CX: entry(() => {}),
      WV: entry((core) => core.halt('wait_for_vector')),
    };
    const float = this.floatEntries(entry, FLOAT_TABLE);
    const double = this.floatEntries(entry, DOUBLE_TABLE);

    // vectors
    view.setUint32(0, BOOT2_RAM, true);
    view.setUint32(4, boot, true);
    for (let i = 2; i < 4; i++) view.setUint32(i * 4, unexpected, true);
    // magic and version
    this.image.set([0x4d, 0x75, 0x01, ROM_VERSION], 0x10);

    here = (here + 15) & ~15;
    const table = (pairs) => {
      const address = here;
      for (const [name, value] of pairs) {
        view.setUint16(here, code(name), true);
        view.setUint16(here + 2, value, true);
        here += 4;
      }
      here += 4; // ends with a zero code
      return address;
    };
    const floatTable = (entries) => {
      here = (here + 7) & ~3;
      view.setUint16(here - 2, entries.length, true); // preceded by its size in words
      const address = here;
      for (const value of entries) {
        view.setUint32(here, value, true);
        here += 4;
      }
      return address;
    };
    const sf = floatTable(float);
    const sd = floatTable(double);
    const text = here;
    this.image.set(new TextEncoder().encode('framestep boot ROM, emulated at a high level\0'), text);
    here = text + 40;
    view.setUint32(here, 0, true);
    const revision = here;
    here += 4;

    view.setUint16(0x14, table(Object.entries(functions)), true);
    view.setUint16(
      0x16,
      table([
        ['CR', text],
        ['GR', revision],
        ['FS', sf],
        ['FE', sd],
        ['SF', sf],
        ['SD', sd],
      ]),
      true
    );
    view.setUint16(0x18, lookup, true);
  }

  floatEntries(entry, table) {
    const entries = [];
    for (const [offset, [, cycles, fn]] of Object.entries(table)) {
      entries[offset / 4] = entry((core) => {
        fn(core);
        core.cyc += cycles;
      });
    }
    return entries;
  }

  /** Words to load as the chip's boot ROM. */
  get words() {
    return new Uint32Array(this.image.buffer);
  }

  call(core, number) {
    this.services[number](core);
  }

  // ------------------------------------------------------------------ services

  /** Reset: start the second-stage boot code in flash, or the vector left by the watchdog. */
  boot(core) {
    const { chip, flash } = this.machine;
    const { r } = core;
    const { scratchData, reason } = chip.watchdog;
    if (reason && scratchData[4] === REBOOT_MAGIC) {
      const [check, sp, pc] = scratchData.subarray(5, 8);
      scratchData[4] = 0;
      if ((check ^ -REBOOT_MAGIC) >>> 0 === pc) {
        r[13] = sp;
        r[15] = pc & ~1;
        return;
      }
    }
    const view = new DataView(flash.buffer, flash.byteOffset, BOOT2_SIZE);
    if (crc32(flash.subarray(0, BOOT2_SIZE - 4)) !== view.getUint32(BOOT2_SIZE - 4, true)) {
      this.machine.bootsel('no valid second-stage boot code in flash');
      return;
    }
    chip.sram.set(flash.subarray(0, BOOT2_SIZE), BOOT2_RAM - 0x20000000);
    r[13] = BOOT2_RAM;
    r[14] = 0; // makes boot2 go on to the program's vector table
    r[15] = BOOT2_RAM;
  }

  lookup(core) {
    const { view } = this;
    let address = core.r[0] & (ROM_BYTES - 1);
    const wanted = core.r[1] & 0xffff;
    let steps = 0;
    for (; view.getUint16(address, true) && view.getUint16(address, true) !== wanted; address += 4) steps++;
    core.r[0] = view.getUint16(address, true) ? view.getUint16(address + 2, true) : 0;
    core.cyc += 11 + 11 * steps;
  }

  bits(core, fn, cycles) {
    core.r[0] = fn(core.r[0]);
    core.cyc += cycles;
  }

  memset(core, aligned) {
    const [to, value, count] = core.r;
    const ram = this.ramRange(core, to, count);
    if (ram) ram.fill(value & 0xff);
    else for (let i = 0; i < count >>> 0; i++) core.store8(to + i, value);
    core.cyc += aligned ? memset4Cycles(count) : memsetCycles(count);
  }

  memcpy(core, aligned) {
    const [to, from, count] = core.r;
    const target = this.ramRange(core, to, count);
    const source = this.ramRange(core, from, count) ?? this.flashRange(core, from, count);
    if (target && source) {
      target.set(source);
    } else {
      for (let i = 0; i < count >>> 0; i++) core.store8(to + i, core.load8(from + i));
    }
    core.cyc += aligned ? memcpy4Cycles(count) : memcpyCycles(count, to, from);
  }

  ramRange(core, address, count) {
    const offset = (address >>> 0) - 0x20000000;
    if (offset < 0 || offset + (count >>> 0) > core.ram8.length) return null;
    return core.ram8.subarray(offset, offset + (count >>> 0));
  }

  /** Reads of flash go through the XIP cache. */
  flashRange(core, address, count) {
    const offset = (address >>> 0) - XIP_BASE;
    if (offset < 0 || offset + (count >>> 0) > core.flash8.length) return null;
    for (let at = offset & ~7; at < offset + (count >>> 0); at += 8) core.xipTouch(at);
    return core.flash8.subarray(offset, offset + (count >>> 0));
  }

  usbBoot(core) {
    this.machine.bootsel('reset_to_usb_boot');
    core.leave();
  }

  exitXip(core) {
    core.cyc += 2000; // for the sequences that end continuous read mode
  }

  wait(core, ms) {
    core.flashBusy = true;
    core.cyc += Math.round((ms * 1e6) / core.cycleNanos);
  }

  erase(core) {
    const { flash } = this.machine;
    const [start, length, blockSize] = core.r;
    let address = start >>> 0;
    const end = address + (length >>> 0);
    let ms = 0;
    while (address < end) {
      if (blockSize > 0 && address % blockSize === 0 && end - address >= blockSize) {
        flash.fill(0xff, address, address + blockSize);
        address += blockSize;
        ms += this.timing.erase64Ms;
      } else {
        flash.fill(0xff, address, address + SECTOR);
        address += SECTOR;
        ms += this.timing.eraseMs;
      }
    }
    this.machine.flashWritten(start >>> 0, end);
    this.wait(core, ms);
  }

  program(core) {
    const { flash } = this.machine;
    const [start, from, length] = core.r;
    for (let i = 0; i < length; i++) {
      flash[(start >>> 0) + i] &= core.load8(from + i); // programming only clears bits
    }
    this.machine.flashWritten(start >>> 0, (start >>> 0) + length);
    this.wait(core, (this.timing.programMs * length) / 256);
  }

  flushCache(core) {
    core.xipFlush();
    core.cyc += 1100;
  }
}

function popcount(x) {
  let count = 0;
  for (; x; x &= x - 1) count++;
  return count;
}

function reverse(x) {
  let result = 0;
  for (let i = 0; i < 32; i++) result |= ((x >>> i) & 1) << (31 - i);
  return result;
}

// Cycles of the block functions by length in bytes, fitted to the real ones as above.

function memsetCycles(count) {
  return count < 8 ? 11 + 2 * count : 37 + (count >> 1);
}

function memset4Cycles(count) {
  return 28 + (count >> 1);
}

function memcpyCycles(count, to, from) {
  if (count < 8) return 11 + 4 * count;
  if ((to ^ from) & 3) return 7 + 7 * count; // byte by byte
  return 35 + Math.round(0.8125 * count);
}

function memcpy4Cycles(count) {
  return 23 + Math.round(0.8125 * count);
}
