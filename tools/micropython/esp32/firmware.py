"""Runs on the simulated ESP32 (tools/micropython/esp32): the firmware as it starts on a board.

Arguments: files with the board's data and the rig file's content, both JSON; files for the output
of I2S, the commands, and the answers (board.c).
"""

import json
import sys

import chip

from framestep.controller import Controller
from framestep.hal.esp32 import start
from framestep.rig import Rig
from framestep.runner import Runner

board, rig, record, commands, answers = sys.argv[1:]
with open(board) as file:
    board = json.load(file)
with open(rig) as file:
    rig = Rig(json.load(file), board)
chip.record(record)
start.clear()
start.drivers_off(rig.board, rig)
hal = start.make(rig.board, rig)
runner = Runner(hal, False)
controller = Controller(hal, rig)
chip.serve(commands, answers)
hal.start()
controller.moves.take_memory()
runner.run(controller)
