// The emulated board in a Web Worker: the browser's counterpart of emu.mjs. Messages are plain objects.
//
// In:  {do: "start", image, files, pins}   a UF2 image, which says the chip, the first content of its file system, levels {pin: 0 or 1}
//      {do: "open", port, on}              a serial port (DTR)
//      {do: "write", port, bytes}
//      {do: "took", port, bytes}           how many of the port's bytes have been processed
//      {do: "pin", pin, level}             0, 1, or null to release it
//      {do: "reset"}                       a power cycle
// Out: {is: "ports", count}                serial ports that the board has now
//      {is: "data", port, bytes}
//      {is: "edges", records, nanos}       of all pins (lib/trace.mjs), up to this moment of the board's time
//      {is: "halted", why}

import { Board } from './lib/board.mjs';
import { Pico2 } from './lib/rp2350/board.mjs';
import { Runner } from './lib/runner.mjs';
import { Trace } from './lib/trace.mjs';
import { imageOf } from './lib/uf2.mjs';

const KINDS = { RP2040: Board, RP2350: Pico2 };
const PORTS = 2;
const EDGES_MS = 30;
const HIGH_WATER = 65536; // bytes of a port on their way to the page
const BOOT_NANOS = 4e9; // a board without a second port has booted by then

// Browsers have no setImmediate, and clamp setTimeout to 4 ms
const waiting = [];
const channel = new MessageChannel();
channel.port1.onmessage = () => waiting.shift()();
globalThis.setImmediate = (callback) => {
  channel.port2.postMessage(null);
  return waiting.push(callback);
};

let board;
let runner;
let bootedAt = 0; // the board's time
const onWay = Array(PORTS).fill(0);

/** While the board boots as fast as this computer can, then in real time. */
function pace(speed) {
  runner.speed = runner.idleSpeed = speed;
  runner.paceFrom();
  runner.wake();
}

function showPorts(count) {
  postMessage({ is: 'ports', count });
}

function onEvent({ type, ports, reason, t }) {
  if (type === 'usb-configured') {
    showPorts(ports);
    if (ports === PORTS) pace(1);
  } else if (type === 'reset' || type === 'power-cycle') {
    showPorts(0);
    bootedAt = t;
    pace(Infinity);
  } else if (type === 'usb-detach') showPorts(0);
  else if (type === 'halt' || type === 'bootsel') postMessage({ is: 'halted', why: reason });
}

function sendEdges() {
  const records = board.trace.take();
  const nanos = board.clock.nanos;
  postMessage({ is: 'edges', records, nanos }, [records.buffer]);
  if (runner.speed !== 1 && nanos > bootedAt + BOOT_NANOS) pace(1);
}

const COMMANDS = {
  start({ image, files, pins }) {
    const { chip, firmware } = imageOf(new Uint8Array(image));
    board = new KINDS[chip]({ firmware, ports: PORTS, onEvent });
    board.flash.set(new Uint8Array(files), board.files.offset);
    board.startTrace(new Trace([...board.outside.keys()]));
    for (const [pin, level] of Object.entries(pins)) board.setPin(Number(pin), Boolean(level));
    for (const [i, port] of board.usb.ports.entries()) {
      port.onData = (bytes) => {
        onWay[i] += bytes.length;
        postMessage({ is: 'data', port: i, bytes }, [bytes.buffer]);
      };
      port.mayReceive = () => onWay[i] < HIGH_WATER;
    }
    runner = new Runner(board);
    runner.start();
    setInterval(sendEdges, EDGES_MS);
  },
  open: ({ port, on }) => board.usb.ports[port].setOpen(on),
  write: ({ port, bytes }) => board.usb.ports[port].write(bytes),
  took({ port, bytes }) {
    onWay[port] -= bytes;
    board.usb.kick();
  },
  pin: ({ pin, level }) => board.setPin(pin, level === null ? null : Boolean(level)),
  reset: () => board.powerCycle(),
};

// An image that is refused, or a fault of the emulator
addEventListener('error', ({ error }) => {
  console.error(error); // close() may keep it from the browser's console
  postMessage({ is: 'halted', why: error.message });
  close();
});

addEventListener('message', ({ data }) => {
  COMMANDS[data.do](data);
  runner.wake();
});
