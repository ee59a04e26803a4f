// The contents of `machine`: the timers and pins, and the reset.
extern const struct _mp_obj_type_t machine_timer_type;
extern const struct _mp_obj_type_t machine_pin_type;
extern const mp_obj_fun_builtin_var_t chip_freq_obj;
extern int board_reset_cause;

#define MICROPY_PY_MACHINE_EXTRA_GLOBALS \
    { MP_ROM_QSTR(MP_QSTR_Timer), MP_ROM_PTR(&machine_timer_type) }, \
    { MP_ROM_QSTR(MP_QSTR_Pin), MP_ROM_PTR(&machine_pin_type) }, \
    { MP_ROM_QSTR(MP_QSTR_freq), MP_ROM_PTR(&chip_freq_obj) }, \
    { MP_ROM_QSTR(MP_QSTR_PWRON_RESET), MP_ROM_INT(1) }, \
    { MP_ROM_QSTR(MP_QSTR_HARD_RESET), MP_ROM_INT(2) }, \
    { MP_ROM_QSTR(MP_QSTR_WDT_RESET), MP_ROM_INT(3) }, \
    { MP_ROM_QSTR(MP_QSTR_SOFT_RESET), MP_ROM_INT(5) },

void board_idle(void);
static void mp_machine_idle(void) {
    board_idle();
}

MP_NORETURN void board_reset(void);
MP_NORETURN static void mp_machine_reset(void) {
    board_reset();
}

static mp_int_t mp_machine_reset_cause(void) {
    return board_reset_cause;
}
