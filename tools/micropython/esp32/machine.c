// The contents of `machine`: the timers and pins.
extern const struct _mp_obj_type_t machine_timer_type;
extern const struct _mp_obj_type_t machine_pin_type;

#define MICROPY_PY_MACHINE_EXTRA_GLOBALS \
    { MP_ROM_QSTR(MP_QSTR_Timer), MP_ROM_PTR(&machine_timer_type) }, \
    { MP_ROM_QSTR(MP_QSTR_Pin), MP_ROM_PTR(&machine_pin_type) },

void board_idle(void);
static void mp_machine_idle(void) {
    board_idle();
}
