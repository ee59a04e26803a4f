#!/usr/bin/env node
// Emulated Raspberry Pi Pico for MicroPython. See ../README.md.

import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { Worker } from 'node:worker_threads';
import { Board } from './lib/board.mjs';
import { chipOf } from './lib/binary_info.mjs';
import { ControlServer } from './lib/control.mjs';
import { Pico2 } from './lib/rp2350/board.mjs';
import { Runner } from './lib/runner.mjs';

const USAGE = `usage: emu.mjs --firmware fw.bin [options]
  --fs IMG            littlefs image for the board's file system
  --put HOST:DEVICE   build such an image with this file in it (may be repeated)
  --flash FILE        keep the whole flash in this file: read at the start, written at the end
  --tcp PORT          USB serial port 1 as raw TCP on 127.0.0.1 (0: any free port)
  --tcp2 PORT         the second USB serial port, if the firmware makes one
  --ctl PORT          control connection, one JSON object a line
  --lockstep          time stands still except while "advance" runs
  --speed X           never run faster than X times real time (default: as fast as possible)
  --idle-speed X      the same while the CPU sleeps and no input waits (default 10)
  --xip-miss N        cycles of a flash cache miss (default 56, 0 turns the cache model off)
  --erase-ms N        flash sector erase time (default 45)
  --program-ms N      flash page program time (default 0.4)
  --seed N            seed of the random numbers (default 1)
  --chip NAME         RP2350, or the RP2040's stepping: B1 has erratum RP2040-E5, B2 has not (default: what the image is for)
  --registers D,C,L,E,N  four 74HC595 at these pins (data, clock, latch, enable); a trace has their outputs as pins N to N + 31
  --exit-with-stdin   end when standard input is closed
  --verbose           log events and accesses to registers that are not emulated`;

function options() {
  const { values } = parseArgs({
    options: {
      firmware: { type: 'string' },
      fs: { type: 'string' },
      put: { type: 'string', multiple: true, default: [] },
      flash: { type: 'string' },
      tcp: { type: 'string' },
      tcp2: { type: 'string' },
      ctl: { type: 'string' },
      lockstep: { type: 'boolean', default: false },
      speed: { type: 'string', default: 'Infinity' },
      'idle-speed': { type: 'string', default: '10' },
      'xip-miss': { type: 'string', default: '56' },
      'erase-ms': { type: 'string', default: '45' },
      'program-ms': { type: 'string', default: '0.4' },
      seed: { type: 'string', default: '1' },
      chip: { type: 'string' },
      registers: { type: 'string' },
      'exit-with-stdin': { type: 'boolean', default: false },
      verbose: { type: 'boolean', default: false },
      help: { type: 'boolean', default: false },
    },
  });
  if (values.help || !values.firmware) {
    console.log(USAGE);
    process.exit(values.help ? 0 : 2);
  }
  return values;
}

/** Build a littlefs image from "host:device" pairs with the Python helper. */
function imageWith(firmware, puts) {
  const image = path.join(fs.mkdtempSync(path.join(os.tmpdir(), 'emulator-fs-')), 'fs.img');
  const python = process.env.PYTHON || 'python3';
  const made = spawnSync(python, ['-m', 'framestep_emulator.image', firmware, image, ...puts], { stdio: ['ignore', 'inherit', 'inherit'] });
  if (made.status !== 0) throw new Error('cannot build the file system image (PYTHON names a Python that has framestep_emulator)');
  const data = fs.readFileSync(image);
  fs.rmSync(path.dirname(image), { recursive: true });
  return data;
}

const REVISIONS = { B0: 1, B1: 1, B2: 2 }; // in CHIP_ID

/** Return the board with a chip, and the chip's revision. */
function kindOf(chip) {
  if (chip === 'RP2350') return { Kind: Pico2, revision: 2 };
  const revision = REVISIONS[chip];
  if (!revision) throw new Error(`--chip ${chip}: expected RP2350 or, of the RP2040, ${Object.keys(REVISIONS).join(', ')}`);
  return { Kind: Board, revision };
}

/** The pins of "2,3,4,5,64". */
function registersAt(text) {
  const [data, clock, latch, enable, first] = text.split(',').map(Number);
  if (![data, clock, latch, enable].every((pin) => pin >= 0 && pin < 30) || !(first >= 30 && first + 32 <= 256)) {
    throw new Error(`--registers ${text}: expected four pins of the chip and a number from 30 to 224`);
  }
  return { data, clock, latch, enable, first };
}

function makeBoard(args) {
  const flashFile = args.flash && fs.existsSync(args.flash) ? fs.readFileSync(args.flash) : null;
  const firmware = fs.readFileSync(args.firmware);
  const { Kind, revision } = kindOf(args.chip ?? (chipOf(firmware) === 'RP2350' ? 'RP2350' : 'B2'));
  const board = new Kind({
    firmware,
    xipMiss: Number(args['xip-miss']),
    timing: { eraseMs: Number(args['erase-ms']), programMs: Number(args['program-ms']) },
    seed: Number(args.seed),
    revision,
    registers: args.registers ? registersAt(args.registers) : null,
    verbose: args.verbose,
    onEvent: (event) => {
      if (args.verbose || event.type === 'halt' || event.type === 'core1') console.error('emu:', JSON.stringify(event));
    },
  });
  const { offset } = board.files;
  if (flashFile) board.flash.set(flashFile.subarray(offset, board.flash.length), offset);
  const image = args.fs ? fs.readFileSync(args.fs) : args.put.length ? imageWith(args.firmware, args.put) : null;
  if (image) board.putFiles(image);
  return board;
}

/** A USB serial port of the board as a TCP server with one client at a time. */
function serveSerial(port, tcpPort, runner) {
  const HIGH_WATER = 65536;
  let client = null;
  const server = net.createServer((socket) => {
    client?.destroy();
    client = socket;
    socket.setNoDelay(true);
    port.setOpen(true);
    runner.wake();
    socket.on('data', (data) => {
      port.write(data);
      if (port.queued > HIGH_WATER) socket.pause();
      runner.wake();
    });
    socket.on('error', () => {});
    socket.on('close', () => {
      if (client !== socket) return;
      client = null;
      port.setOpen(false);
      runner.wake();
    });
    socket.on('drain', () => {
      runner.board.usb.kick();
      runner.wake();
    });
  });
  port.onDrain = () => {
    if (client?.isPaused() && port.queued < HIGH_WATER / 2) client.resume();
  };
  port.onTcpData = (data) => {
    client?.write(data);
    return client !== null;
  };
  port.leave = () => {
    const socket = client;
    client = null;
    socket?.destroy();
  };
  port.mayReceive = () => !client || client.writableLength < HIGH_WATER;
  server.listen(tcpPort, '127.0.0.1');
  return server;
}

/** End with the parent process even if the emulation never returns to the event loop. */
function dieWithParent() {
  const watch = `
    const parent = process.ppid;
    setInterval(() => process.ppid === parent || process.kill(process.pid, 'SIGKILL'), 500);`;
  new Worker(watch, { eval: true }).unref();
}

const listening = (server) =>
  new Promise((resolve, reject) => {
    server.once('listening', () => resolve(server.address().port));
    server.once('error', reject);
  });

async function main() {
  process.env.TZ = 'UTC'; // rp2040js' clock chip works in local time
  const args = options();
  const board = makeBoard(args);
  const runner = new Runner(board, {
    lockstep: args.lockstep,
    speed: Number(args.speed),
    idleSpeed: Number(args['idle-speed']),
  });
  const quit = (status = 0) => {
    if (args.flash) fs.writeFileSync(args.flash, board.flash);
    board.stopTrace();
    process.exit(status);
  };
  const control = new ControlServer(runner, quit);

  const ready = { ready: true };
  for (const [i, name] of ['tcp', 'tcp2'].entries()) {
    if (args[name] !== undefined) ready[name] = await listening(serveSerial(board.usb.ports[i], Number(args[name]), runner));
  }
  if (args.ctl !== undefined) ready.ctl = await listening(control.listen(Number(args.ctl)));
  process.on('SIGTERM', () => quit());
  process.on('SIGINT', () => quit());
  if (args['exit-with-stdin']) {
    dieWithParent();
    process.stdin.resume();
    process.stdin.on('end', () => quit());
    process.stdin.on('error', () => quit());
  }
  console.log(JSON.stringify(ready));
  runner.start();
}

main().catch((error) => {
  console.error(`emu: ${error.message}`);
  process.exit(1);
});
