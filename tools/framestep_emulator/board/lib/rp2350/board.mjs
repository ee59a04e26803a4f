// A Raspberry Pi Pico 2: the board of the parent folder with another chip, ROM and flash.

import { Board } from '../board.mjs';
import { Chip2350 } from './chip.mjs';
import { BootRom2350 } from './rom.mjs';

const FLASH_SIZE = 4 * 1024 * 1024;

export class Pico2 extends Board {
  constructor(options) {
    super({ ...options, translate: null });
  }
  get chipName() {
    return 'RP2350';
  }
  makeFlash() {
    return new Uint8Array(FLASH_SIZE);
  }
  makeRom(timing) {
    return new BootRom2350(this, timing);
  }
  makeChip(options) {
    return new Chip2350(options);
  }
  putFirmware(firmware) {
    super.putFirmware(firmware);
    this.core?.restored();
  }
  putFiles(image) {
    super.putFiles(image);
    this.core?.restored();
  }
  flashWritten(from, to) {
    this.flashDirty = true;
    this.core.flashChanged(from, to);
    this.core.xipFlush();
  }
  restored() {
    this.core.restored();
  }
  pressBootsel(on) {
    this.bootselPressed = on;
    this.chip.qspi[1].padValue |= 0x40;
    this.chip.qspi[1].rawInputValue = !on;
  }
}
