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

#include "py/ringbuf.h"
extern ringbuf_t stdin_ringbuf;
