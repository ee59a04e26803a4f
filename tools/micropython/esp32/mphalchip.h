// Additions to mphalport.h for the chip: pins as numbers.
#pragma once
#include <stdlib.h>
#include "py/obj.h"
#include "hal/gpio_types.h"

#define MP_HAL_PIN_FMT "%u"
#define mp_hal_pin_obj_t gpio_num_t
gpio_num_t machine_pin_get_id(mp_obj_t pin);
#define mp_hal_get_pin_obj(pin) machine_pin_get_id(pin)
#define mp_hal_pin_name(pin) (pin)
#define mp_hal_pin_output(pin) gpio_set_direction(pin, GPIO_MODE_INPUT_OUTPUT)
#define mp_hal_pin_write(pin, level) gpio_set_level(pin, level)

#include "py/ringbuf.h"
extern ringbuf_t stdin_ringbuf;
#define mp_hal_wake_main_task_from_isr()
