// A Raspberry Pi Pico 2: the board of the parent folder with another chip, ROM and flash.

import { Board } from '../board.mjs';
import { Chip2350 } from './chip.mjs';
import { Native2350 } from './native.mjs';
import { BootRom2350 } from './rom.mjs';

export class Pico2 extends Board {
  get chipName() {
    return 'RP2350';
  }
  makeNative(options) {
    return new Native2350(options);
  }
  makeRom(timing) {
    return new BootRom2350(this, timing);
  }
  makeChip(options) {
    return new Chip2350(options);
  }
  flashWritten(from, to) {
    super.flashWritten(from, to);
    this.core.xipFlush();
  }
  pressBootsel(on) {
    this.bootselPressed = on;
    this.chip.qspi[1].padValue |= 0x40;
    this.chip.qspi[1].rawInputValue = !on;
  }
}
