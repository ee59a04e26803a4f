# shellcheck shell=bash
# Sourced by setup.sh and micropython/build.sh: steps that show their progress, and host packages.

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
CACHE=$(realpath -m "${FRAMESTEP_CACHE:-$ROOT/.cache}")
LOG=$CACHE/log
COUNTER=

note() { printf '%s\n' "$*" >&2; }
die() { note "$*"; exit 1; }

# step NAME TITLE COMMAND... runs the command with its output in NAME.log, of which the end is shown only if it
# fails. One line per step on standard error, with the seconds it took; on a terminal they count while it runs.
step() {
    local log=$LOG/$1.log title=$2 began=$SECONDS status=0
    shift 2
    mkdir -p "$LOG"
    printf '  %s ... ' "$title" >&2
    if [ -t 2 ]; then
        (while sleep 1; do printf '\r  %s ... %d s ' "$title" $((SECONDS - began)) >&2; done) 9>&- &
        COUNTER=$!
    fi
    "$@" >"$log" 2>&1 || status=$?
    stop_counter
    if [ $status -ne 0 ]; then
        printf 'failed\n' >&2
        tail -n 40 "$log" >&2
        note "This failed (the whole output is in $log): $*"
        return $status
    fi
    printf '%s%d s\n' "$([ -t 2 ] && printf '\r  %s ... ' "$title")" $((SECONDS - began)) >&2
}

stop_counter() {
    [ -n "$COUNTER" ] || return 0
    kill "$COUNTER" 2>/dev/null || true
    wait "$COUNTER" 2>/dev/null || true
    COUNTER=
}
trap stop_counter EXIT

# need_packages PURPOSE PACKAGE... installs missing packages as root; otherwise names them in one sentence.
need_packages() {
    local purpose=$1 missing=() package
    shift
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
        die "To $purpose, framestep needs apt and dpkg (Debian or Ubuntu), which are missing here."
    for package in "$@"; do
        [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    [ "$(id -u)" = 0 ] ||
        die "To $purpose, these packages are missing: ${missing[*]}. Install them with: sudo apt-get install ${missing[*]}"
    step apt-install "installing ${missing[*]}" install_packages "${missing[@]}"
}

install_packages() {
    apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends "$@"
}

# Allow one build at a time in one cache.
lock() {
    mkdir -p "$CACHE" "$LOG"
    if command -v flock >/dev/null; then
        exec 9>"$CACHE/.lock"
        flock -n 9 || { note "  waiting for another build in $CACHE"; flock 9; }
    fi
}
