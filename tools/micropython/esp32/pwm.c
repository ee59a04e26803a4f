// LEDC, ESP-IDF's PWM: channels whose pulses begin with the periods of a timer. A new duty counts from the next period on.
#include "driver/ledc.h"
#include "chip.h"

static struct channel {
    bool on, high;
    int pin;
    uint32_t hz, resolution, duty, next_duty;
    uint64_t began, changes_at;  // this period, and the next edge or period, ns
} channels[LEDC_SPEED_MODE_MAX][LEDC_CHANNEL_MAX];
static struct { uint32_t hz, resolution; } timers[LEDC_SPEED_MODE_MAX][LEDC_TIMER_MAX];

#define EACH(c) (struct channel *c = &channels[0][0]; c < &channels[0][0] + LEDC_SPEED_MODE_MAX * LEDC_CHANNEL_MAX; c++)

static void drive(struct channel *c, bool level) {
    if (level != c->high) {
        c->high = level;
        line_edge(c->pin, level);
    }
}

static void begin_period(struct channel *c, uint64_t now) {
    c->began = now;
    c->duty = c->next_duty;
    uint64_t period = 1000000000ull / c->hz, width = period * c->duty >> c->resolution;
    drive(c, width > 0);
    c->changes_at = now + (width > 0 && width < period ? width : period);
}

uint64_t pwm_next(void) {
    uint64_t next = NEVER;
    for EACH(c) {
        if (c->on && c->changes_at < next) {
            next = c->changes_at;
        }
    }
    return next;
}

void pwm_event(void) {
    for EACH(c) {
        if (c->on && c->changes_at <= chip_now) {
            uint64_t end = c->began + 1000000000ull / c->hz;
            if (c->changes_at == end) {
                begin_period(c, end);
            } else {
                drive(c, false);
                c->changes_at = end;
            }
        }
    }
}

// ---------------------------------------------------------------- ESP-IDF

uint32_t ledc_find_suitable_duty_resolution(uint32_t source_hz, uint32_t hz) {
    uint32_t bits = 0;
    while (bits < SOC_LEDC_TIMER_BIT_WIDTH && source_hz / hz >> (bits + 1)) {
        bits++;
    }
    return bits;
}

esp_err_t ledc_timer_config(const ledc_timer_config_t *config) {
    timers[config->speed_mode][config->timer_num].hz = config->freq_hz;
    timers[config->speed_mode][config->timer_num].resolution = config->duty_resolution;
    return ESP_OK;
}

esp_err_t ledc_set_freq(ledc_mode_t mode, int timer, uint32_t hz) {
    timers[mode][timer].hz = hz;
    return ESP_OK;
}

uint32_t ledc_get_freq(ledc_mode_t mode, int timer) {
    return timers[mode][timer].hz;
}

esp_err_t ledc_channel_config(const ledc_channel_config_t *config) {
    struct channel *c = &channels[config->speed_mode][config->channel];
    if (!GPIO_IS_VALID_OUTPUT_GPIO(config->gpio_num)) {
        return ESP_ERR_INVALID_ARG;
    }
    if (config->flags.output_invert) {
        return ESP_ERR_NOT_SUPPORTED;  // in this model
    }
    c->pin = config->gpio_num;
    c->hz = timers[config->speed_mode][config->timer_sel].hz;
    c->resolution = timers[config->speed_mode][config->timer_sel].resolution;
    c->next_duty = config->duty;
    c->on = true;
    begin_period(c, chip_now);
    return ESP_OK;
}

esp_err_t ledc_set_duty(ledc_mode_t mode, int channel, uint32_t duty) {
    channels[mode][channel].next_duty = duty;
    return ESP_OK;
}

esp_err_t ledc_update_duty(ledc_mode_t mode, int channel) {
    return ESP_OK;
}

uint32_t ledc_get_duty(ledc_mode_t mode, int channel) {
    return channels[mode][channel].duty;
}

esp_err_t ledc_stop(ledc_mode_t mode, int channel, uint32_t level) {
    struct channel *c = &channels[mode][channel];
    if (c->on) {
        drive(c, level);
        c->on = false;
    }
    return ESP_OK;
}
