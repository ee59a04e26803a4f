// A board from power-up on, as in main.c of MicroPython's port for ESP32: files in flash, boot.py, main.py and the REPL on
// the UART, and the same again after a soft reset.
#include <stdlib.h>
#include "py/builtin.h"
#include "py/gc.h"
#include "py/mphal.h"
#include "py/runtime.h"
#include "shared/readline/readline.h"
#include "shared/runtime/pyexec.h"
#include "modmachine.h"
#include "shared/tinyusb/mp_usbd.h"
#include "../bare/host.h"
#include "chip.h"

void free_code(void);
void machine_timer_deinit_all(void);
void machine_pwm_deinit_all(void);
extern const mp_obj_type_t esp32_partition_type;

static void run(void) {
    pyexec_frozen_module("_boot.py", false);
    int ended = pyexec_file_if_exists("boot.py");
    if (usb_present()) {
        mp_usbd_init();  // here since MicroPython 1.27
    }
    if (!(ended & PYEXEC_FORCED_EXIT) && pyexec_mode_kind == PYEXEC_MODE_FRIENDLY_REPL && ended) {
        ended = pyexec_file_if_exists("main.py");
    }
    while (!(ended & PYEXEC_FORCED_EXIT)) {
        ended = pyexec_mode_kind == PYEXEC_MODE_RAW_REPL ? pyexec_raw_repl() : pyexec_friendly_repl();
    }
}

// words: the files of the flash, the record, the commands and the answers, the time at power-up, ns, the cause of this
// start, the host's rate at the REPL's UART, and whether there is USB
void board_boot(void *heap, size_t bytes, char **words) {
    chip_now = strtoull(words[4], NULL, 10);
    board_reset_cause = atoi(words[5]);
    uart_set_host_rate(atoi(words[6]));
    if (atoi(words[7])) {
        usb_plug(true);
    }
    i2s_record = host_open(words[1], HOST_WRITE);
    if (!flash_open(words[0]) || i2s_record < 0) {
        host_exit(2);
    }
    gc_init(heap, (char *)heap + bytes);
    mp_init();
    board_serve(words[2], words[3]);
    for (;;) {
        gc_init(heap, (char *)heap + bytes);
        mp_init();
        mp_obj_list_append(mp_sys_path, MP_OBJ_NEW_QSTR(MP_QSTR__slash_lib));
        readline_init0();
        machine_pins_init();
        machine_i2s_init0();
        run();
        machine_timer_deinit_all();
        mp_usbd_deinit();
        gc_sweep_all();
        free_code();
        mp_hal_stdout_tx_str("MPY: soft reboot\r\n");
        machine_pwm_deinit_all();
        machine_pins_deinit();
        board_reset_cause = 5;  // SOFT_RESET
        mp_deinit();
    }
}

static const mp_rom_map_elem_t names[] = {
    { MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_esp32) },
    { MP_ROM_QSTR(MP_QSTR_Partition), MP_ROM_PTR(&esp32_partition_type) },
};
static MP_DEFINE_CONST_DICT(globals, names);
const mp_obj_module_t esp32_module = { .base = { &mp_type_module }, .globals = (mp_obj_dict_t *)&globals };
MP_REGISTER_MODULE(MP_QSTR_esp32, esp32_module);
