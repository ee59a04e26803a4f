// What MicroPython's Timer uses of ESP-IDF.
#pragma once
#include <assert.h>
#include "esp_err.h"

typedef struct { int group; } timg_dev_t;
typedef struct { timg_dev_t *dev; uint32_t timer_id; } timer_hal_context_t;
typedef void *intr_handle_t;
struct timer_group_signals { struct { int module; int timer_irq_id[2]; } groups[2]; };
extern const struct timer_group_signals timer_group_periph_signals;

#define SOC_TIMER_GROUP_TIMERS_PER_GROUP 2
#define SOC_TIMER_GROUP_TOTAL_TIMERS 4
#define GPTIMER_CLK_SRC_DEFAULT 0
#define GPTIMER_COUNT_UP 1
#define ESP_CLK_TREE_SRC_FREQ_PRECISION_CACHED 0
#define TIMER_LL_EVENT_ALARM(index) (1u << (index))
#define PERIPH_RCC_ACQUIRE_ATOMIC(module, count) for (int count = 1, once = ((void)(module), 1); once; once = 0)

// clocks and buses are always on here
#define esp_clk_tree_enable_src(source, on)
#define timer_ll_enable_bus_clock(group, on)
#define timer_ll_reset_register(group)
#define timer_ll_set_clock_source(dev, index, source)
#define timer_ll_enable_clock(dev, index, on)
#define timer_ll_set_count_direction(dev, index, way)
#define timer_ll_set_reload_value(dev, index, value)  // always 0

esp_err_t esp_clk_tree_src_get_freq_hz(int source, int precision, uint32_t *hz);
void timer_hal_init(timer_hal_context_t *hal, uint32_t group, uint32_t index);
void timer_hal_set_counter_value(timer_hal_context_t *hal, uint64_t value);
void timer_ll_enable_counter(timg_dev_t *dev, uint32_t index, bool on);
void timer_ll_enable_alarm(timg_dev_t *dev, uint32_t index, bool on);
void timer_ll_set_alarm_value(timg_dev_t *dev, uint32_t index, uint64_t value);
void timer_ll_enable_auto_reload(timg_dev_t *dev, uint32_t index, bool on);
void timer_ll_set_clock_prescale(timg_dev_t *dev, uint32_t index, uint32_t divider);
void timer_ll_enable_intr(timg_dev_t *dev, uint32_t mask, bool on);
uint32_t timer_ll_get_intr_status(timg_dev_t *dev);
void timer_ll_clear_intr_status(timg_dev_t *dev, uint32_t mask);
uint64_t timer_ll_get_counter_value(timg_dev_t *dev, uint32_t index);
esp_err_t esp_intr_alloc(int source, int flags, void (*handler)(void *), void *argument, intr_handle_t *handle);
esp_err_t esp_intr_enable(intr_handle_t handle);
esp_err_t esp_intr_disable(intr_handle_t handle);
esp_err_t esp_intr_free(intr_handle_t handle);
