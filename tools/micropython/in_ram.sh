#!/usr/bin/env bash
# Compiles a C file of an image for speed: in_ram.sh COMPILER ARGUMENT...
# Checks the names below in a built image:  in_ram.sh --check NM BUILD TREE
#
# The functions named here run from RAM. The flash cache of an RP2040 (16 kB) is too small for MicroPython's interpreter
# and framestep's own code together. The functions for calls and look-ups, and those that lead to the tick, are copied
# to RAM at the start: pico-sdk's linker script copies sections called .time_critical. They take 10.6 kB; `make bench` shows
# their effect.
set -euo pipefail

FUNCTIONS=(
    # the interpreter
    mp_execute_bytecode mp_setup_code_state mp_setup_code_state_helper fun_bc_call fun_viper_call
    mp_call_function_n_kw mp_call_method_n_kw mp_call_method_self_n_kw mp_call_function_1_protected mp_native_from_obj
    mp_native_to_obj nlr_pop mp_cstack_check mp_cstack_usage mp_thread_get_state
    mp_obj_is_true mp_obj_get_type mp_obj_get_int_truncated mp_handle_pending
    # names and attributes
    mp_map_lookup mp_load_global mp_load_attr mp_load_method mp_load_method_maybe mp_convert_member_lookup
    mp_obj_instance_attr mp_obj_class_lookup qstr_hash
    # reading an array in the tick
    mp_get_buffer array_get_buffer
    # calls
    nlr_push nlr_push_tail mp_native_swap_globals fun_builtin_0_call
    # from the timer's interrupt to the tick
    alarm_pool_irq_handler alarm_callback mp_sched_schedule mp_sched_lock mp_sched_unlock gc_lock gc_unlock
)

# The same, of versions of MicroPython other than the pinned one
ELSEWHERE=(
    mp_irq_dispatch # calls the timer's callback from 1.27 on
)

# pico-sdk has these in RAM, but framestep rarely or never calls them
FROM_FLASH=(
    mutex_enter_blocking mutex_enter_block_until mutex_enter_timeout_ms mutex_try_enter
    mutex_exit recursive_mutex_try_enter spi_write_blocking spi_write_read_blocking
)

# Files that are compiled for speed instead of size
FAST=(
    # the interpreter
    argcheck binary nativeglue obj objarray objboundmeth objdict objfun objint objtuple objtype qstr runtime scheduler
    # USB
    cdc_device dcd_rp2040 mp_usbd mp_usbd_cdc mp_usbd_runtime mphalport rp2040_usb sys_stdio_mphal tusb_fifo usbd
)

# A name that the compiler or another version of MicroPython does not know has no effect, and nobody would notice.
check() {
    local nm=$1 build=$2 tree=$3 symbols address name wrong=() wanted=("${FUNCTIONS[@]}")
    declare -A found
    symbols=$("$nm" "$build/firmware.elf")
    while read -r address _ name; do found[$name]=$address; done <<<"$symbols"
    for name in "${ELSEWHERE[@]}"; do
        if grep -rqw --include='*.c' "$name" "$tree/py" "$tree/shared" "$tree/ports"; then wanted+=("$name"); fi
    done
    for name in "${wanted[@]}"; do
        case ${found[$name]:-none} in
            2*) ;;
            none) wrong+=("$name is not in the image") ;;
            *) wrong+=("$name is not in RAM") ;;
        esac
    done
    for name in "${FROM_FLASH[@]}"; do
        case ${found[$name]:-none} in
            1*) ;;
            none) wrong+=("$name is not in the image") ;;
            *) wrong+=("$name is not in flash") ;;
        esac
    done
    for name in "${FAST[@]}"; do
        [ -n "$(find "$build" -name "$name.c.o*" -print -quit)" ] || wrong+=("no file $name.c is compiled")
    done
    [ ${#wrong[@]} = 0 ] || { printf 'tools/micropython/in_ram.sh: %s; correct the name there\n' "${wrong[@]}" >&2; return 1; }
}

if [ "$1" = --check ]; then
    check "${@:2}"
    exit
fi

renames=()
for name in "${FUNCTIONS[@]}" "${ELSEWHERE[@]}"; do renames+=(--rename-section ".text.$name=.time_critical.$name"); done
for name in "${FROM_FLASH[@]}"; do renames+=(--rename-section ".time_critical.$name=.text.$name"); done

command=("$@")
object=
for ((i = 1; i < $#; i++)); do
    [ "${command[i]}" != -o ] || object=${command[i + 1]}
done
for name in "${FAST[@]}"; do
    case "$object" in
        */$name.c.o) command+=(-O2) ;;
    esac
done

"${command[@]}"
case $object in
    *.o | *.obj) "${1%gcc}objcopy" "${renames[@]}" "$object" ;;
esac
