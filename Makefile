# framestep: `make help` lists the targets that most need, `make help-all` all of them. Builds and caches live in .cache (FRAMESTEP_CACHE moves it), results in build/.
SHELL := /bin/bash
CACHE := $(abspath $(or $(FRAMESTEP_CACHE),.cache))
PYTHON_VENV := $(CACHE)/venv/bin/python
PROCESSES := $(shell echo $$(($$(nproc) + 2))) # more than processors: some tests wait for a page or a port
PYTEST := PYTHONHASHSEED=0 "$(PYTHON_VENV)" -m pytest -q -n $(PROCESSES) --dist loadfile --no-loadscope-reorder

# The layers of make test: what each needs first, and its files
NEEDS_core := setup
NEEDS_runtime := runtimes
NEEDS_board := node images
NEEDS_emulator := node images
NEEDS_console := node images chromium
FILES_runtime := host_tests/runtime host_tests/esp32
FILES_board := host_tests/board
FILES_emulator := host_tests/emulator
FILES_console := host_tests/console
FILES_core := $(foreach layer,runtime board emulator console,$(FILES_$(layer):%=--ignore=%))

# A target of make test-sessions whose image is not one of each chip's
IMAGES_rp2350_595 := pico2_595

ARGS ?=
LAYER :=

ifneq ($(LAYER),)
ifeq ($(NEEDS_$(LAYER)),)
$(error LAYER=$(LAYER) is none of core, runtime, board, emulator, console)
endif
endif

# A target's ARGS do not count for the targets that its recipe makes: `make test ARGS=-x` makes an image, too.
MAKEOVERRIDES :=
unexport ARGS LAYER BOARD TARGET PORT SECONDS SEED MICROPYTHON
# Compiled modules are kept: each process of tests would compile them again, for seconds.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help help-all setup node chromium micropython runtimes images demo try site sim emu check test test-all test-sessions console-pictures fuzz lint types format \
	plots bench profile drawn flash image install release emulator-measure conform prove clean

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*[^#]## / { printf "  make %-17s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

help-all: ## show all targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-17s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ### Python packages in .cache/venv; nothing to do the second time
	@tools/setup.sh python

node: ### the emulator's node package
	@tools/setup.sh node

chromium: ### a browser for the tests of the console, if none is installed
	@tools/setup.sh chromium

micropython: setup ### build MicroPython for the RP2040 and for 32-bit tests on this computer (three minutes, once)
	@tools/micropython/build.sh all

runtimes: setup # MicroPython for tests on this computer
	@tools/micropython/build.sh runtimes

images: micropython # the boards' images, which tests need; the build takes a minute the first time, then some seconds
	@"$(PYTHON_VENV)" -m framestep_tools.building.images

try: setup node ### static pages: framestep on an emulated board in the browser (build/site/try), and its installer (build/site/install)
	@"$(PYTHON_VENV)" -m framestep_tools.site.try_page

site: setup node ## the documents as a web site, with the pages of make try in it (build/site); builds without network
	@"$(PYTHON_VENV)" -m framestep_tools.site.documents

demo: setup ## play a camera move on the emulated board, check every edge, plot it (build/demo); BOARD=pico or all
	@if tools/setup.sh node && "$(PYTHON_VENV)" -m framestep_tools.building.make_image --board $(or $(BOARD),pico); then where=; \
	else echo "The emulated board is not available here; the demo runs on the host simulation instead." >&2; where=--host; fi; \
	"$(PYTHON_VENV)" -m framestep_tools.demo --board $(or $(BOARD),pico) $$where $(ARGS)

sim: setup ## the controller on this computer, on a pseudo-terminal; ARGS="--tcp 127.0.0.1:7000 --trace FILE"
	@"$(PYTHON_VENV)" -m framestep_tools sim $(ARGS)

emu: setup node ## the controller on the emulated board, on a pseudo-terminal; BOARD=pico, ARGS as for sim, and --repl
	@"$(PYTHON_VENV)" -m framestep_tools.building.make_image --board $(or $(BOARD),pico) >&2
	@"$(PYTHON_VENV)" -m framestep_tools.commands.emu --board $(or $(BOARD),pico) $(ARGS)

flash: setup ## copy edited modules onto a board with framestep's image: PORT=/dev/ttyACM0 if there are several; ARGS=--clean removes them
	@"$(PYTHON_VENV)" -m framestep_tools flash $(if $(PORT),--port $(PORT)) $(ARGS)

image: setup ## MicroPython with framestep in it: build/BOARD.uf2; BOARD=pico or all, and MICROPYTHON=path of a checkout
	@"$(PYTHON_VENV)" -m framestep_tools.building.make_image --board $(or $(BOARD),pico) $(if $(MICROPYTHON),--micropython $(MICROPYTHON)) $(ARGS)

install: setup ## build the image and put it on a board plugged in with BOOTSEL held: BOARD=pico
	@"$(PYTHON_VENV)" -m framestep_tools install --board $(or $(BOARD),pico) $(ARGS)

release: setup node ### the files of a release (build/release): the package for pip, images, pages, sums, notes
	@"$(PYTHON_VENV)" -m framestep_tools.site.release

test: $(if $(LAYER),$(NEEDS_$(LAYER)),lint types node images chromium) ## everything: style, types, and every layer of tests; LAYER=core, runtime, board, emulator or console: that one
	@$(PYTEST) $(FILES_$(LAYER)) $(ARGS)

test-all: lint types node images chromium ### make test, and a third of the tests with other values and on other processors; ARGS=--all plays them all
	@$(PYTEST) --third $(ARGS)

check: lint types ## while you work: style, types, and the tests nearest to your changes since main, in a minute
	@PYTHONHASHSEED=0 "$(PYTHON_VENV)" -m pytest -q -n $(PROCESSES) --near=main $(ARGS)

test-sessions: TARGET := $(or $(TARGET),esp32)
test-sessions: setup node ### the end-to-end scenarios on another target: TARGET=esp32, rp2040, rp2350, rp2350_595, device with PORT=, or replay (again on 32-bit MicroPython, the heap locked); ARGS="--share 10" plays every tenth
	$(if $(filter replay,$(TARGET)),@tools/micropython/build.sh unix32f)
	$(if $(filter esp32,$(TARGET)),@tools/micropython/build.sh esp32)
	$(if $(filter rp2%,$(TARGET)),@tools/micropython/build.sh rp2 && "$(PYTHON_VENV)" -m framestep_tools.building.images $(or $(IMAGES_$(TARGET)),pico pico2))
	@$(if $(filter device,$(TARGET)),"$(PYTHON_VENV)" -m pytest -q --port $(PORT),$(PYTEST)) $(if $(filter replay,$(TARGET)),--replay,--target $(TARGET)) host_tests/end_to_end $(ARGS)

console-pictures: setup chromium ### take pictures of the console, to look at (build/console); ARGS=--states: of each state in each size and theme
	@"$(PYTHON_VENV)" -m host_tests.console.pictures $(ARGS)

fuzz: setup ## random sessions, checked for what must never happen: SECONDS=60, SEED=7, ARGS="--minutes 15 --replay"; TARGET=rp2040, rp2350 or esp32: on that chip; failures become scripts in build/fuzz
	$(if $(filter esp32,$(TARGET)),@tools/micropython/build.sh esp32)
	$(if $(filter rp2%,$(TARGET)),@tools/setup.sh node && tools/micropython/build.sh rp2)
	@"$(PYTHON_VENV)" -m host_tests.fuzz.fuzz --seconds $(or $(SECONDS),60) $(if $(SEED),--seed $(SEED)) $(if $(TARGET),--target $(TARGET)) $(ARGS)

lint: setup ### style (ruff, oxlint, shellcheck), spelling (codespell), and subjects of commits
	@"$(PYTHON_VENV)" -m ruff check --show-files | grep -q '[.]py$$' || { echo "ruff finds no Python file to check"; exit 1; }
	@"$(PYTHON_VENV)" -m ruff check --quiet && "$(PYTHON_VENV)" -m ruff format --check --quiet
	@"$(CACHE)/venv/bin/oxlint" --format=unix
	@git ls-files -z -- "*.sh" .ci/run | xargs -0 "$(CACHE)/venv/bin/shellcheck" --severity=warning
	@git ls-files -z | xargs -0 "$(PYTHON_VENV)" -m codespell_lib
	@tools/check_subjects.sh

types: setup ### types of the host tools, and of all code of the board against MicroPython's stubs (mypy)
	@"$(PYTHON_VENV)" tools/check_types.py

format: setup ### bring the source into ruff's form
	@"$(PYTHON_VENV)" -m ruff check --fix --quiet; "$(PYTHON_VENV)" -m ruff format --quiet

plots: setup chromium ### draw the pictures in docs again
	@"$(PYTHON_VENV)" -m framestep_tools.documents.plot_interpolation
	@"$(PYTHON_VENV)" -m framestep_tools.documents.plot_virtuals
	@"$(PYTHON_VENV)" -m framestep_tools.documents.rig_picture
	@"$(PYTHON_VENV)" -m framestep_tools.documents.coil_picture
	@"$(PYTHON_VENV)" -m host_tests.console.drawings

bench: setup node micropython ## measure the firmware on the emulated board against its goals (build/bench.json); ARGS=--explain
	@"$(PYTHON_VENV)" -m framestep_tools.bench $(ARGS)

profile: setup node micropython ### where the processor's time goes: ARGS=upload, single-port, play, go, servos or answers
	@"$(PYTHON_VENV)" -m framestep_tools.bench.profile $(ARGS)

drawn: setup node micropython ### moves drawn at random with all motors of an emulated board, judged edge by edge; ARGS="--board pico2 --minutes 10"
	@"$(PYTHON_VENV)" -m framestep_tools.bench.drawn $(ARGS)

conform: setup ### the conformance kit against the simulator and against seeded faults: both scores; BOARD=pico2: on that emulated board, ARGS="--subject framing": a part
	$(if $(filter esp32%,$(BOARD)),@tools/micropython/build.sh esp32,$(if $(BOARD),@tools/setup.sh node && tools/micropython/build.sh rp2))
	@"$(PYTHON_VENV)" -m host_tests.conform.score $(if $(BOARD),--board $(BOARD)) $(ARGS)

prove: setup node micropython ### the emulated board measures itself, like a real one with `framestep lab prove` (build/prove); BOARD=pico or all, ARGS="--chip B1" or --renew
	@"$(PYTHON_VENV)" -m framestep_tools.prove $(if $(BOARD),--board $(BOARD)) $(ARGS)

emulator-measure: setup node micropython ### measure the emulated boards themselves (three minutes)
	@tools/micropython/build.sh rp2350
	@"$(PYTHON_VENV)" -m framestep_emulator.measure --pico "$(CACHE)/build/rp2/firmware.bin" \
		--pico2 "$(CACHE)/build/rp2350/firmware.bin" --benchmarks "$(CACHE)/src/micropython/tests/perf_bench" $(ARGS)

clean: ### remove build/ and .cache, everything that can be made again
	rm -rf build .cache tools/framestep_emulator/board/node_modules
