// ESP-IDF's results that MicroPython's bindings check.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

typedef int esp_err_t;
enum {
    ESP_OK = 0, ESP_FAIL = -1, ESP_ERR_NO_MEM = 0x101, ESP_ERR_INVALID_ARG = 0x102, ESP_ERR_INVALID_STATE = 0x103, ESP_ERR_NOT_FOUND = 0x105,
    ESP_ERR_NOT_SUPPORTED = 0x106, ESP_ERR_TIMEOUT = 0x107,
};
#define IRAM_ATTR
#define ESP_ERROR_CHECK(code) do { if ((code) != ESP_OK) { abort(); } } while (0)

void check_esp_err_(esp_err_t code);
#define check_esp_err(code) check_esp_err_(code)
#define mp_hal_wake_main_task_from_isr()
