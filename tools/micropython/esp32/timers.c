// The four general timers: a counter from 0, and an alarm that reloads itself. While interrupts are off an alarm waits;
// a second one meanwhile is the same interrupt.
#include "py/mpconfig.h"
#include "hal/timer_hal.h"
#include "chip.h"

#define SOURCE_HZ 80000000ull

struct gp_timer {
    bool counting, alarm, reload, interrupt, pending, enabled;
    uint32_t divider;
    uint64_t began, value, limit;  // ns at count 0
    void (*handler)(void *);
    void *argument;
};
static struct gp_timer timers[4];
static timg_dev_t groups[2] = { { 0 }, { 1 } };
const struct timer_group_signals timer_group_periph_signals = { { { 0, { 0, 1 } }, { 1, { 2, 3 } } } };

static struct gp_timer *of(const timg_dev_t *dev, uint32_t index) {
    return &timers[dev->group * 2 + index];
}

static uint64_t due(const struct gp_timer *t) {
    if (!t->counting || !t->alarm) {
        return NEVER;
    }
    uint64_t at = t->began + t->limit * t->divider * 1000000000ull / SOURCE_HZ;
    return at < chip_now ? chip_now : at;
}

static struct gp_timer *first_due(void) {
    struct gp_timer *first = &timers[0];
    for (int i = 1; i < 4; i++) {
        if (due(&timers[i]) < due(first)) {
            first = &timers[i];
        }
    }
    return first;
}

uint64_t timers_next(void) {
    return due(first_due());
}

static void interrupt(struct gp_timer *t) {
    if (t->pending && t->interrupt && t->enabled && chip_interrupts) {
        t->handler(t->argument);
    }
}

void timers_event(void) {
    struct gp_timer *t = first_due();
    t->pending = true;
    t->alarm = false;  // until the handler sets it again
    if (t->reload) {
        t->began = chip_now;
    }
    interrupt(t);
}

void timers_interrupt(void) {
    for (int i = 0; i < 4; i++) {
        interrupt(&timers[i]);
    }
}

// ---------------------------------------------------------------- ESP-IDF

esp_err_t esp_clk_tree_src_get_freq_hz(int source, int precision, uint32_t *hz) {
    *hz = SOURCE_HZ;
    return ESP_OK;
}

void timer_hal_init(timer_hal_context_t *hal, uint32_t group, uint32_t index) {
    hal->dev = &groups[group];
    hal->timer_id = index;
}

void timer_hal_set_counter_value(timer_hal_context_t *hal, uint64_t value) {
    struct gp_timer *t = of(hal->dev, hal->timer_id);
    t->value = value;
    t->began = chip_now - value * t->divider * 1000000000ull / SOURCE_HZ;
}

uint64_t timer_ll_get_counter_value(timg_dev_t *dev, uint32_t index) {
    const struct gp_timer *t = of(dev, index);
    return t->counting ? (chip_now - t->began) * (SOURCE_HZ / 1000000) / 1000 / t->divider : t->value;
}

void timer_ll_enable_counter(timg_dev_t *dev, uint32_t index, bool on) {
    struct gp_timer *t = of(dev, index);
    if (on && !t->counting) {
        t->began = chip_now - t->value * t->divider * 1000000000ull / SOURCE_HZ;
    } else if (!on && t->counting) {
        t->value = timer_ll_get_counter_value(dev, index);
    }
    t->counting = on;
}

void timer_ll_enable_alarm(timg_dev_t *dev, uint32_t index, bool on) {
    of(dev, index)->alarm = on;
}

void timer_ll_set_alarm_value(timg_dev_t *dev, uint32_t index, uint64_t value) {
    of(dev, index)->limit = value;
}

void timer_ll_enable_auto_reload(timg_dev_t *dev, uint32_t index, bool on) {
    of(dev, index)->reload = on;
}

void timer_ll_set_clock_prescale(timg_dev_t *dev, uint32_t index, uint32_t divider) {
    of(dev, index)->divider = divider;
}

void timer_ll_enable_intr(timg_dev_t *dev, uint32_t mask, bool on) {
    for (uint32_t i = 0; i < 2; i++) {
        if (mask & TIMER_LL_EVENT_ALARM(i)) {
            of(dev, i)->interrupt = on;
        }
    }
}

uint32_t timer_ll_get_intr_status(timg_dev_t *dev) {
    return of(dev, 0)->pending | of(dev, 1)->pending << 1;
}

void timer_ll_clear_intr_status(timg_dev_t *dev, uint32_t mask) {
    for (uint32_t i = 0; i < 2; i++) {
        if (mask & TIMER_LL_EVENT_ALARM(i)) {
            of(dev, i)->pending = false;
        }
    }
}

esp_err_t esp_intr_alloc(int source, int flags, void (*handler)(void *), void *argument, intr_handle_t *handle) {
    struct gp_timer *t = &timers[source];
    t->handler = handler;
    t->argument = argument;
    t->enabled = true;
    *handle = t;
    return ESP_OK;
}

esp_err_t esp_intr_enable(intr_handle_t handle) {
    ((struct gp_timer *)handle)->enabled = true;
    return ESP_OK;
}

esp_err_t esp_intr_disable(intr_handle_t handle) {
    ((struct gp_timer *)handle)->enabled = false;
    return ESP_OK;
}

esp_err_t esp_intr_free(intr_handle_t handle) {
    return esp_intr_disable(handle);
}
