// I2S like ESP-IDF's driver: a ring of DMA buffers that plays from the time it is enabled. An interrupt clears each
// played buffer and puts it into a queue of free ones; writing fills the buffer that has waited longest.
//
// A writer does not learn that it is late. The queue holds one buffer less than the ring; if it is full, the oldest
// one drops out. While interrupts are off the ring plays its old content again, and the buffers played meanwhile are neither
// cleared nor free: afterwards one interrupt comes for all of them, about the last.
//
// The record of what was played: for each buffer its time in ns (8 bytes), its number of bytes (4), and the bytes.
#include <string.h>
#include "py/mperrno.h"
#include "py/runtime.h"
#include "driver/i2s_std.h"
#include "freertos/FreeRTOS.h"
#include "../bare/host.h"
#include "chip.h"

#define MOST_BUFFERS 64
#define DMA_MEMORY (128 * 1024)  // about the largest block of a WROOM module

struct i2s_channel {
    bool used, running, waiting;  // an interrupt waits
    uint32_t count, frames, bytes, rate;
    uint8_t *buffers[MOST_BUFFERS], *free_ones[MOST_BUFFERS], *last;
    uint32_t free_count;
    uint8_t *current;  // being written
    uint32_t at;
    uint64_t began, played;  // ns; buffers
    i2s_event_callbacks_t callbacks;
    void *user;
    uint32_t memory[DMA_MEMORY / sizeof(uint32_t)];
};

static struct i2s_channel channels[I2S_NUM_AUTO];
int i2s_record = -1;

static uint64_t start_of(const struct i2s_channel *c, uint64_t number) {
    return c->began + number * c->frames * 1000000000ull / c->rate;
}

static struct i2s_channel *first_due(void) {
    struct i2s_channel *first = NULL;
    for (int i = 0; i < I2S_NUM_AUTO; i++) {
        struct i2s_channel *c = &channels[i];
        if (c->running && (!first || start_of(c, c->played + 1) < start_of(first, first->played + 1))) {
            first = c;
        }
    }
    return first;
}

uint64_t i2s_next(void) {
    const struct i2s_channel *c = first_due();
    return c ? start_of(c, c->played + 1) : NEVER;
}

static void sent(struct i2s_channel *c) {
    c->waiting = false;
    if (c->callbacks.on_sent) {
        i2s_event_data_t event = { c->last, c->bytes };
        c->callbacks.on_sent(c, &event, c->user);
    }
    if (c->free_count == c->count - 1) {
        memmove(c->free_ones, c->free_ones + 1, --c->free_count * sizeof c->free_ones[0]);
    }
    memset(c->last, 0, c->bytes);
    c->free_ones[c->free_count++] = c->last;
}

void i2s_event(void) {
    struct i2s_channel *c = first_due();
    c->last = c->buffers[c->played % c->count];
    if (i2s_record >= 0) {
        uint64_t from = start_of(c, c->played);
        host_write(i2s_record, &from, sizeof from);
        host_write(i2s_record, &c->bytes, sizeof c->bytes);
        host_write(i2s_record, c->last, c->bytes);
    }
    c->played++;
    c->waiting = true;
    if (chip_interrupts) {
        sent(c);
    }
}

void i2s_interrupt(void) {
    for (int i = 0; i < I2S_NUM_AUTO; i++) {
        if (channels[i].waiting) {
            sent(&channels[i]);
        }
    }
}

// ---------------------------------------------------------------- ESP-IDF

void check_esp_err_(esp_err_t code) {
    if (code != ESP_OK) {
        mp_raise_OSError(code == ESP_ERR_NO_MEM ? MP_ENOMEM : code == ESP_ERR_TIMEOUT ? MP_ETIMEDOUT
            : code == ESP_ERR_NOT_SUPPORTED ? MP_EOPNOTSUPP : -code);
    }
}

esp_err_t i2s_new_channel(const i2s_chan_config_t *config, i2s_chan_handle_t *tx, i2s_chan_handle_t *rx) {
    struct i2s_channel *c = &channels[config->id];
    if (!tx) {
        return ESP_ERR_NOT_SUPPORTED;  // this model does not receive
    }
    if (c->used) {
        return ESP_ERR_NOT_FOUND;
    }
    memset(c, 0, offsetof(struct i2s_channel, memory));
    c->used = true;
    c->count = config->dma_desc_num;
    c->frames = config->dma_frame_num;
    *tx = c;
    return ESP_OK;
}

esp_err_t i2s_channel_init_std_mode(i2s_chan_handle_t c, const i2s_std_config_t *config) {
    uint32_t slots = config->slot_cfg.slot_mode == I2S_SLOT_MODE_STEREO ? 2 : 1;
    c->rate = config->clk_cfg.sample_rate_hz;
    c->bytes = c->frames * slots * config->slot_cfg.data_bit_width / 8;
    // the master clock is 256 times the rate, and the source's 160 MHz must be more than 1.99 times that
    esp_err_t result = c->rate == 0 || c->rate * 256ull * 199 >= 160000000ull * 100 ? ESP_ERR_INVALID_ARG
        : c->count > MOST_BUFFERS || c->count * c->bytes > DMA_MEMORY ? ESP_ERR_NO_MEM : ESP_OK;
    if (result != ESP_OK) {
        return result;  // the channel stays in use, as on the chip
    }
    memset(c->memory, 0, c->count * c->bytes);
    for (uint32_t i = 0; i < c->count; i++) {
        c->buffers[i] = (uint8_t *)c->memory + i * c->bytes;
    }
    return ESP_OK;
}

esp_err_t i2s_channel_register_event_callback(i2s_chan_handle_t c, const i2s_event_callbacks_t *callbacks, void *user) {
    c->callbacks = *callbacks;
    c->user = user;
    return ESP_OK;
}

esp_err_t i2s_channel_enable(i2s_chan_handle_t c) {
    c->running = true;
    c->began = chip_now;
    c->played = c->free_count = 0;
    return ESP_OK;
}

esp_err_t i2s_channel_disable(i2s_chan_handle_t c) {
    c->running = c->waiting = false;
    c->current = NULL;
    return ESP_OK;
}

esp_err_t i2s_del_channel(i2s_chan_handle_t c) {
    c->used = false;
    return ESP_OK;
}

esp_err_t i2s_channel_write(i2s_chan_handle_t c, const void *from, size_t size, size_t *written, uint32_t timeout) {
    const uint8_t *data = from;
    *written = 0;
    while (size && c->running) {
        if (!c->current || c->at == c->bytes) {
            if (!c->free_count && timeout == 0) {
                return ESP_ERR_TIMEOUT;
            }
            while (!c->free_count) {
                chip_advance(start_of(c, c->played + 1) - chip_now);
            }
            c->current = c->free_ones[0];
            memmove(c->free_ones, c->free_ones + 1, --c->free_count * sizeof c->free_ones[0]);
            c->at = 0;
        }
        uint32_t n = MIN(c->bytes - c->at, size);
        memcpy(c->current + c->at, data, n);
        c->at += n;
        data += n;
        size -= n;
        *written += n;
    }
    return ESP_OK;
}

esp_err_t i2s_channel_read(i2s_chan_handle_t c, void *to, size_t size, size_t *count, uint32_t timeout) {
    return ESP_ERR_NOT_SUPPORTED;
}

// ---------------------------------------------------------------- FreeRTOS

// There are no tasks: irq() of an I2S, which needs one, raises RuntimeError.
QueueHandle_t xQueueCreate(int length, int size) {
    return NULL;
}

int xQueueSend(QueueHandle_t queue, const void *what, TickType_t ticks) {
    return 0;
}

int xQueueReceive(QueueHandle_t queue, void *what, TickType_t ticks) {
    return 0;
}

void vQueueDelete(QueueHandle_t queue) {
}

int xTaskCreatePinnedToCore(void (*run)(void *), const char *name, int stack, void *argument, int priority,
    TaskHandle_t *task, int core) {
    return 0;
}

void vTaskDelete(TaskHandle_t task) {
}
