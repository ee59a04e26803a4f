// Virtual time: only these calls take time, so every run is the same. Scripts control it through the module `chip`.
//
//     chip.advance(us)           time passes, as in a long pass or between passes
//     chip.flash(us)             a sector is erased: time passes, no interrupt comes, DMA continues
//     chip.collection(us)        how long each garbage collection takes from now on
//     chip.drive(pin, level)     drive a pin from outside
//     chip.now()                 µs since the start
//     chip.code()                bytes of machine code in memory, which is outside of the heap
//     chip.record(path)          record what I2S plays in this file: see i2s.c
//     chip.serve(commands, answers)  from the next machine.idle() on commands in a file let time pass: see board.c
#include "py/runtime.h"
#include "../bare/host.h"
#include "chip.h"

size_t code_bytes(void);
uint64_t chip_now;
bool chip_interrupts = true;
static uint64_t collection_ns;

void chip_advance(uint64_t ns) {
    uint64_t end = chip_now + ns;
    for (;;) {
        uint64_t i2s = i2s_next(), timer = timers_next(), uart = uart_next(), line = lines_next();
        uint64_t next = MIN(MIN(MIN(i2s, line), MIN(timer, uart)), MIN(watchdog_next(), MIN(pwm_next(), usb_next())));
        if (next > end) {
            break;
        }
        chip_now = next;
        if (i2s == next) {
            i2s_event();
        } else if (timer == next) {
            timers_event();
        } else if (uart == next) {
            uart_event();
        } else if (line == next) {
            lines_event();
        } else if (usb_next() == next) {
            usb_event();
        } else if (pwm_next() == next) {
            pwm_event();
        } else {
            watchdog_event();
        }
    }
    chip_now = end;
}

void chip_wait(int ms) {
    chip_advance(ms * 1000000ull);
}

void chip_collected(void) {
    chip_advance(collection_ns);
}

static uint64_t ns_of(mp_obj_t us) {
    mp_int_t number = mp_obj_get_int(us);
    if (number < 0) {
        mp_raise_ValueError(MP_ERROR_TEXT("time does not go back"));
    }
    return (uint64_t)number * 1000;
}

static mp_obj_t advance(mp_obj_t us) {
    chip_advance(ns_of(us));
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_1(advance_obj, advance);

void chip_flash(uint64_t ns) {
    chip_interrupts = false;
    chip_advance(ns);
    chip_interrupts = true;
    i2s_interrupt();
    timers_interrupt();
    pins_interrupt();
    lines_interrupt();
}

static mp_obj_t flash(mp_obj_t us) {
    chip_flash(ns_of(us));
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_1(flash_obj, flash);

static mp_obj_t collection(mp_obj_t us) {
    collection_ns = ns_of(us);
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_1(collection_obj, collection);

static mp_obj_t drive(mp_obj_t pin, mp_obj_t level) {
    if (!pins_drive(mp_obj_get_int(pin), mp_obj_is_true(level))) {
        mp_raise_ValueError(MP_ERROR_TEXT("no such pin"));
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_2(drive_obj, drive);

static mp_obj_t now(void) {
    return mp_obj_new_int_from_ull(chip_now / 1000);
}
static MP_DEFINE_CONST_FUN_OBJ_0(now_obj, now);

static mp_obj_t code(void) {
    return mp_obj_new_int(code_bytes());
}
static MP_DEFINE_CONST_FUN_OBJ_0(code_obj, code);

static mp_obj_t record(mp_obj_t path) {
    i2s_record = host_open(mp_obj_str_get_str(path), HOST_WRITE);
    if (i2s_record < 0) {
        mp_raise_ValueError(MP_ERROR_TEXT("no such folder"));
    }
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_1(record_obj, record);

static mp_obj_t serve(mp_obj_t commands, mp_obj_t answers) {
    board_serve(mp_obj_str_get_str(commands), mp_obj_str_get_str(answers));
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_2(serve_obj, serve);

// machine.freq: the clock can be set, but code takes no time anyway
static mp_obj_t freq(size_t count, const mp_obj_t *args) {
    static mp_int_t hz = 160000000;
    if (count == 0) {
        return mp_obj_new_int(hz);
    }
    mp_int_t wanted = mp_obj_get_int(args[0]);
    if (wanted != 20000000 && wanted != 40000000 && wanted != 80000000 && wanted != 160000000 && wanted != 240000000) {
        mp_raise_ValueError(MP_ERROR_TEXT("frequency must be 20MHz, 40MHz, 80Mhz, 160MHz or 240MHz"));
    }
    hz = wanted;
    return mp_const_none;
}
MP_DEFINE_CONST_FUN_OBJ_VAR_BETWEEN(chip_freq_obj, 0, 1, freq);

static const mp_rom_map_elem_t names[] = {
    { MP_ROM_QSTR(MP_QSTR___name__), MP_ROM_QSTR(MP_QSTR_chip) },
    { MP_ROM_QSTR(MP_QSTR_advance), MP_ROM_PTR(&advance_obj) },
    { MP_ROM_QSTR(MP_QSTR_flash), MP_ROM_PTR(&flash_obj) },
    { MP_ROM_QSTR(MP_QSTR_collection), MP_ROM_PTR(&collection_obj) },
    { MP_ROM_QSTR(MP_QSTR_drive), MP_ROM_PTR(&drive_obj) },
    { MP_ROM_QSTR(MP_QSTR_now), MP_ROM_PTR(&now_obj) },
    { MP_ROM_QSTR(MP_QSTR_code), MP_ROM_PTR(&code_obj) },
    { MP_ROM_QSTR(MP_QSTR_record), MP_ROM_PTR(&record_obj) },
    { MP_ROM_QSTR(MP_QSTR_serve), MP_ROM_PTR(&serve_obj) },
};
static MP_DEFINE_CONST_DICT(globals, names);
const mp_obj_module_t chip_module = { .base = { &mp_type_module }, .globals = (mp_obj_dict_t *)&globals };
MP_REGISTER_MODULE(MP_QSTR_chip, chip_module);
