// ESP-IDF's watchdog for tasks, for a single user: an interrupt that restarts the chip. It runs from the first user on,
// cannot be stopped, and each new configuration begins anew.
#include "esp_task_wdt.h"
#include "chip.h"

static uint64_t timeout_ns, due = NEVER;
static bool used;

uint64_t watchdog_next(void) {
    return due;
}

void watchdog_event(void) {
    due = NEVER;
    if (chip_interrupts) {
        board_end(STATE_WATCHDOG);
    }
    due = chip_now + 1000000;  // the interrupt waits
}

static void restart(void) {
    due = used ? chip_now + timeout_ns : NEVER;
}

esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t *config) {
    timeout_ns = config->timeout_ms * 1000000ull;
    restart();
    return ESP_OK;
}

esp_err_t esp_task_wdt_add_user(const char *name, esp_task_wdt_user_handle_t *user) {
    used = true;
    *user = &used;
    restart();
    return ESP_OK;
}

esp_err_t esp_task_wdt_reset_user(esp_task_wdt_user_handle_t user) {
    restart();
    return ESP_OK;
}
