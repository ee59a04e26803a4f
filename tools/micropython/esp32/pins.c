// The pins: levels from outside, pulls and interrupts. If interrupts are off, a pin interrupts once, afterwards.
#include "py/obj.h"
#include "driver/gpio.h"
#include "driver/rtc_io.h"
#include "machine_rtc.h"
#include "machine_pin.h"
#include "chip.h"

machine_rtc_config_t machine_rtc_config;
typeof(GPIO) GPIO;

static struct {
    bool outside, high;  // driven from outside, and how
    bool out, drives, up, pending;
    gpio_isr_t handler;
    void *argument;
} pins[GPIO_PIN_COUNT];

extern const mp_obj_type_t machine_pin_type;

// the pins of the port's machine_pin.h
#define PIN { { &machine_pin_type }, { { &machine_pin_irq_type } } }
const machine_pin_obj_t machine_pin_obj_table[GPIO_NUM_MAX] = {
    #if MICROPY_HW_ENABLE_GPIO0
    [0] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO1
    [1] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO2
    [2] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO3
    [3] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO4
    [4] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO5
    [5] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO6
    [6] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO7
    [7] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO8
    [8] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO9
    [9] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO10
    [10] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO11
    [11] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO12
    [12] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO13
    [13] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO14
    [14] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO15
    [15] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO16
    [16] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO17
    [17] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO18
    [18] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO19
    [19] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO20
    [20] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO21
    [21] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO22
    [22] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO23
    [23] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO24
    [24] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO25
    [25] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO26
    [26] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO27
    [27] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO28
    [28] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO29
    [29] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO30
    [30] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO31
    [31] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO32
    [32] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO33
    [33] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO34
    [34] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO35
    [35] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO36
    [36] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO37
    [37] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO38
    [38] = PIN,
    #endif
    #if MICROPY_HW_ENABLE_GPIO39
    [39] = PIN,
    #endif
};

static const mp_map_elem_t no_names[1];
const mp_obj_dict_t machine_pin_board_pins_locals_dict = {
    .base = { &mp_type_dict }, .map = { .is_fixed = 1, .is_ordered = 1, .table = (mp_map_elem_t *)no_names } };

int gpio_get_level(gpio_num_t pin) {
    return pins[pin].drives ? pins[pin].out : pins[pin].outside ? pins[pin].high : pins[pin].up;
}

static void interrupt(gpio_num_t pin) {
    if (pins[pin].pending && chip_interrupts) {
        pins[pin].pending = false;
        if (pins[pin].handler) {
            pins[pin].handler(pins[pin].argument);
        }
    }
}

static void changed(gpio_num_t pin, int before) {
    int level = gpio_get_level(pin);
    if (level != before && GPIO.pin[pin].int_type & (level ? GPIO_INTR_POSEDGE : GPIO_INTR_NEGEDGE)) {
        pins[pin].pending = true;
        interrupt(pin);
    }
}

bool pins_drive(unsigned pin, int level) {
    if (pin >= GPIO_PIN_COUNT) {
        return false;
    }
    int before = gpio_get_level(pin);
    pins[pin].outside = true;
    pins[pin].high = level;
    changed(pin, before);
    return true;
}

void pins_interrupt(void) {
    for (int pin = 0; pin < GPIO_PIN_COUNT; pin++) {
        interrupt(pin);
    }
}

// ---------------------------------------------------------------- ESP-IDF

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level) {
    int before = gpio_get_level(pin);
    pins[pin].out = level;
    changed(pin, before);
    return ESP_OK;
}

esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode) {
    pins[pin].drives = mode & GPIO_MODE_DEF_OUTPUT;
    return ESP_OK;
}

esp_err_t gpio_set_intr_type(gpio_num_t pin, gpio_int_type_t trigger) {
    GPIO.pin[pin].int_type = trigger;
    return ESP_OK;
}

esp_err_t gpio_isr_handler_add(gpio_num_t pin, gpio_isr_t handler, void *argument) {
    pins[pin].handler = handler;
    pins[pin].argument = argument;
    return ESP_OK;
}

esp_err_t gpio_isr_handler_remove(gpio_num_t pin) {
    pins[pin].handler = NULL;
    return ESP_OK;
}

esp_err_t gpio_pullup_en(gpio_num_t pin) {
    pins[pin].up = true;
    return ESP_OK;
}

esp_err_t gpio_pullup_dis(gpio_num_t pin) {
    pins[pin].up = false;
    return ESP_OK;
}

int mp_hal_pin_read_output(gpio_num_t pin) {
    return pins[pin].out;
}
