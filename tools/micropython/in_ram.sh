#!/usr/bin/env bash
# Compiles a C file of an image, and has the functions named here run from RAM: in_ram.sh COMPILER ARGUMENT...
#
# The flash cache of an RP2040 (16 kB) is too small for MicroPython's interpreter and framestep's own code together.
# What calls and looks up most, and what leads to the tick, is copied to RAM at the start: pico-sdk's linker script does
# it with sections called .time_critical. They take 12 kB; `make bench` shows what they are worth.
set -euo pipefail

FUNCTIONS=(
    # the interpreter
    mp_execute_bytecode mp_setup_code_state mp_setup_code_state_helper fun_bc_call fun_viper_call
    mp_call_function_n_kw mp_call_method_n_kw mp_call_method_self_n_kw mp_call_function_1_protected mp_native_from_obj
    mp_native_to_obj nlr_pop mp_cstack_check mp_cstack_usage mp_thread_get_state mp_binary_op
    mp_obj_is_true mp_obj_get_type mp_obj_get_int_truncated mp_handle_pending
    # names and attributes
    mp_map_lookup mp_load_global mp_load_attr mp_load_method mp_load_method_maybe mp_convert_member_lookup
    mp_obj_instance_attr mp_obj_class_lookup find_qstr qstr_hash
    # arrays
    array_get_buffer array_subscr mp_get_buffer mp_binary_get_size mp_get_index mp_obj_subscr
    # from the timer's interrupt to the tick
    alarm_pool_irq_handler alarm_callback mp_sched_schedule
    # refuses at once while the heap is locked, as it is in a pass
    gc_alloc
)

renames=()
for name in "${FUNCTIONS[@]}"; do renames+=(--rename-section ".text.$name=.time_critical.$name"); done

"$@"
for ((i = 1; i < $#; i++)); do
    [ "${!i}" = -o ] || continue
    object=$((i + 1))
    case ${!object} in
        *.o | *.obj) "${1%gcc}objcopy" "${renames[@]}" "${!object}" ;;
    esac
done
