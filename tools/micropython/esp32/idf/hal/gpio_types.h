// What MicroPython's Pin uses of ESP-IDF.
#pragma once
#include "esp_err.h"

typedef int gpio_num_t;
#define GPIO_PIN_COUNT 40
#define GPIO_NUM_MAX GPIO_PIN_COUNT
typedef enum { GPIO_INTR_DISABLE, GPIO_INTR_POSEDGE, GPIO_INTR_NEGEDGE, GPIO_INTR_ANYEDGE, GPIO_INTR_LOW_LEVEL, GPIO_INTR_HIGH_LEVEL } gpio_int_type_t;
#define GPIO_MODE_DEF_OUTPUT 2
typedef enum { GPIO_MODE_INPUT = 1, GPIO_MODE_INPUT_OUTPUT = 3, GPIO_MODE_INPUT_OUTPUT_OD = 7 } gpio_mode_t;
enum { GPIO_DRIVE_CAP_0, GPIO_DRIVE_CAP_1, GPIO_DRIVE_CAP_2, GPIO_DRIVE_CAP_3, GPIO_DRIVE_CAP_MAX };
typedef void (*gpio_isr_t)(void *);
#define GPIO_IS_VALID_OUTPUT_GPIO(pin) ((pin) < 34)

extern struct { struct { gpio_int_type_t int_type; } pin[GPIO_PIN_COUNT]; } GPIO;  // registers

int gpio_get_level(gpio_num_t pin);
esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level);
esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode);
esp_err_t gpio_set_intr_type(gpio_num_t pin, gpio_int_type_t trigger);
esp_err_t gpio_isr_handler_add(gpio_num_t pin, gpio_isr_t handler, void *argument);
esp_err_t gpio_isr_handler_remove(gpio_num_t pin);
esp_err_t gpio_pullup_en(gpio_num_t pin);
esp_err_t gpio_pullup_dis(gpio_num_t pin);
int mp_hal_pin_read_output(gpio_num_t pin);

// these do not change levels here
#define gpio_install_isr_service(flags)
#define gpio_pulldown_en(pin)
#define gpio_pulldown_dis(pin)
#define gpio_set_drive_capability(pin, strength)
#define gpio_hold_en(pin)
#define gpio_hold_dis(pin)
#define rtc_gpio_is_valid_gpio(pin) false
#define rtc_gpio_deinit(pin)
#define esp_rom_gpio_pad_select_gpio(pin)
