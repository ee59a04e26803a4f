// What MicroPython's PWM uses of ESP-IDF's LEDC.
#pragma once
#include "hal/gpio_types.h"

#define ESP_IDF_VERSION_VAL(major, minor, patch) ((major) << 16 | (minor) << 8 | (patch))
#define ESP_IDF_VERSION ESP_IDF_VERSION_VAL(5, 4, 2)
#define SOC_LEDC_SUPPORT_APB_CLOCK 1
#define SOC_LEDC_SUPPORT_REF_TICK 1
#define SOC_LEDC_SUPPORT_HS_MODE 1
#define SOC_LEDC_TIMER_BIT_WIDTH 20
typedef enum { LEDC_HIGH_SPEED_MODE, LEDC_LOW_SPEED_MODE, LEDC_SPEED_MODE_MAX } ledc_mode_t;
enum { LEDC_TIMER_MAX = 4, LEDC_CHANNEL_MAX = 8, LEDC_INTR_DISABLE = 0 };
typedef enum { LEDC_AUTO_CLK, LEDC_USE_REF_TICK, LEDC_USE_APB_CLK, LEDC_USE_RC_FAST_CLK } ledc_clk_cfg_t;
typedef struct {
    ledc_mode_t speed_mode;
    int duty_resolution, timer_num;
    uint32_t freq_hz;
    ledc_clk_cfg_t clk_cfg;
    bool deconfigure;
} ledc_timer_config_t;
typedef struct {
    int gpio_num;
    ledc_mode_t speed_mode;
    int channel, intr_type, timer_sel;
    uint32_t duty;
    int hpoint;
    struct { unsigned output_invert : 1; } flags;
} ledc_channel_config_t;

uint32_t ledc_find_suitable_duty_resolution(uint32_t source_hz, uint32_t hz);
esp_err_t ledc_timer_config(const ledc_timer_config_t *config);
esp_err_t ledc_channel_config(const ledc_channel_config_t *config);
esp_err_t ledc_set_freq(ledc_mode_t mode, int timer, uint32_t hz);
uint32_t ledc_get_freq(ledc_mode_t mode, int timer);
esp_err_t ledc_set_duty(ledc_mode_t mode, int channel, uint32_t duty);
esp_err_t ledc_update_duty(ledc_mode_t mode, int channel);
uint32_t ledc_get_duty(ledc_mode_t mode, int channel);
esp_err_t ledc_stop(ledc_mode_t mode, int channel, uint32_t level);

// these change nothing here
#define ledc_timer_rst(mode, timer) ESP_OK
#define ledc_timer_pause(mode, timer) ESP_OK
#define gpio_sleep_sel_en(pin) ESP_OK
#define gpio_sleep_sel_dis(pin) ESP_OK
#define esp_rom_gpio_connect_out_signal(pin, signal, invert, enable)
