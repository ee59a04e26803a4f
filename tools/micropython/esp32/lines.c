// UARTs 1 and 2 as ESP-IDF's driver runs them, and as much of UART 0 as it can do for the REPL's, which has no driver.
//
// To be sent: a ring of whole items, of which a write that finds no room waits for some, and the 128 bytes of the hardware,
// which an interrupt fills again. Received bytes wait in the hardware while interrupts are off; if there are too many, the
// driver drops them all. Bytes on a TX pin go to the program that drives the board, with the time of their first bit.
#include <string.h>
#include "py/mphal.h"
#include "driver/uart.h"
#include "chip.h"

#define HARDWARE 128
#define REFILL 10  // bytes left in the hardware at which the interrupt comes
#define CLOCK_HZ 80000000ull
#define FASTEST 5000000
#define ITEM_HEAD 8  // of an item in the ring
#define EVENT 16  // item that comes before the data of a write
#define MOST_HEARD (1 << 15)
#define MOST_BUFFER 4096

struct uart {
    bool installed;
    uint32_t divider;  // sixteenths of the clock's periods
    uint8_t stop_bits;
    int tx, rx;
    uint32_t send_size, receive_size;
    uint8_t send[MOST_BUFFER], receive[MOST_BUFFER];
    uint32_t send_count, receive_count;  // bytes in them
    uint32_t items;  // room that the waiting items take
    uint32_t at;  // next byte of `send` for the hardware
    uint8_t fifo[HARDWARE], heard[HARDWARE];
    uint32_t fifo_count, heard_count;
    uint64_t first_bit, sent_at;  // of the byte on the wire
    uint8_t coming[MOST_HEARD];
    uint32_t coming_at, coming_count;
    uint64_t comes_at;  // when the first of `coming` has arrived
};
static struct uart uarts[UART_NUM_MAX];

static struct line_byte said[LINE_BYTES];
static uint32_t said_count;

static uint64_t bits_ns(const struct uart *u, uint32_t bits) {
    return bits * (uint64_t)u->divider * 1000000000ull / (16 * CLOCK_HZ);
}

static uint32_t frame_bits(const struct uart *u) {
    return 9 + u->stop_bits;
}

static uint32_t room_of(uint32_t bytes) {
    return ITEM_HEAD + ((bytes + 3) & ~3);
}

// ---------------------------------------------------------------- the wire

static void begin_byte(struct uart *u, uint64_t now) {
    u->first_bit = now;
    u->sent_at = now + bits_ns(u, frame_bits(u));
    if (u->tx >= 0 && said_count < LINE_BYTES) {
        said[said_count++] = (struct line_byte) { now, u->divider, u->tx, u->fifo[0], frame_bits(u), 0 };
    }
}

// The interrupt that fills the hardware.
static void refill(struct uart *u) {
    while (chip_interrupts && u->at < u->send_count && u->fifo_count < HARDWARE) {
        bool idle = !u->fifo_count;
        u->fifo[u->fifo_count++] = u->send[u->at++];
        if (idle) {
            begin_byte(u, chip_now);
        }
    }
    if (u->at == u->send_count) {
        u->at = u->send_count = u->items = 0;
    }
}

static void byte_sent(struct uart *u) {
    memmove(u->fifo, u->fifo + 1, --u->fifo_count);
    if (u->fifo_count) {
        begin_byte(u, u->sent_at);
    }
    if (u->fifo_count <= REFILL) {
        refill(u);
    }
}

// The interrupt that takes bytes from the hardware; it comes for each, since MicroPython sets that.
static void take_heard(struct uart *u) {
    if (chip_interrupts) {
        uint32_t count = MIN(u->heard_count, u->receive_size - u->receive_count);
        memcpy(u->receive + u->receive_count, u->heard, count);
        u->receive_count += count;
        u->heard_count = 0;
    }
}

static void byte_came(struct uart *u) {
    uint8_t byte = u->coming[u->coming_at];
    u->coming_at = (u->coming_at + 1) % MOST_HEARD;
    u->coming_count--;
    u->comes_at += bits_ns(u, frame_bits(u));
    if (u->installed) {
        if (u->heard_count == HARDWARE) {
            u->heard_count = 0;
        }
        u->heard[u->heard_count++] = byte;
        take_heard(u);
    }
}

uint64_t lines_next(void) {
    uint64_t next = NEVER;
    for (struct uart *u = uarts; u < uarts + UART_NUM_MAX; u++) {
        next = MIN(next, u->fifo_count ? u->sent_at : NEVER);
        next = MIN(next, u->coming_count ? MAX(u->comes_at, chip_now) : NEVER);
    }
    return next;
}

void lines_event(void) {
    for (struct uart *u = uarts; u < uarts + UART_NUM_MAX; u++) {
        if (u->fifo_count && u->sent_at <= chip_now) {
            byte_sent(u);
        }
        if (u->coming_count && u->comes_at <= chip_now) {
            byte_came(u);
        }
    }
}

void lines_interrupt(void) {
    for (struct uart *u = uarts; u < uarts + UART_NUM_MAX; u++) {
        refill(u);
        take_heard(u);
    }
}

void line_receive(int pin, uint64_t first_bit, const uint8_t *bytes, uint32_t count) {
    for (struct uart *u = uarts; u < uarts + UART_NUM_MAX; u++) {
        if (u->installed && u->rx == pin) {
            uint64_t first = MAX(first_bit, chip_now) + bits_ns(u, frame_bits(u));
            if (!u->coming_count && u->comes_at < first) {
                u->comes_at = first;
            }
            while (count-- && u->coming_count < MOST_HEARD) {
                u->coming[(u->coming_at + u->coming_count++) % MOST_HEARD] = *bytes++;
            }
            return;
        }
    }
}

void line_edge(int pin, int level) {
    if (said_count < LINE_BYTES) {
        said[said_count++] = (struct line_byte) { chip_now, 0, pin, level, 0, 0 };
    }
}

uint32_t line_said(const struct line_byte **bytes) {
    uint32_t count = said_count;
    *bytes = said;
    said_count = 0;
    return count;
}

bool line_has_said(int pin) {
    for (uint32_t i = 0; i < said_count; i++) {
        if (said[i].pin == pin) {
            return true;
        }
    }
    return said_count > LINE_BYTES / 2;  // they have to be taken before there are too many
}

// ---------------------------------------------------------------- ESP-IDF

static struct uart *driver(uart_port_t number) {
    return number >= 0 && number < UART_NUM_MAX && uarts[number].installed ? &uarts[number] : NULL;
}

esp_err_t uart_set_baudrate(uart_port_t number, uint32_t rate) {
    if (rate == 0 || rate > FASTEST) {
        return ESP_FAIL;
    }
    uarts[number].divider = CLOCK_HZ * 16 / rate;
    if (number == UART_NUM_0) {
        uart_set_rate(rate);
    }
    return ESP_OK;
}

esp_err_t uart_get_baudrate(uart_port_t number, uint32_t *rate) {
    *rate = number == UART_NUM_0 ? uart_rate() : CLOCK_HZ * 16 / uarts[number].divider;
    return ESP_OK;
}

esp_err_t uart_set_word_length(uart_port_t number, uart_word_length_t bits) {
    return bits == UART_DATA_8_BITS ? ESP_OK : ESP_ERR_NOT_SUPPORTED;  // in this model
}

esp_err_t uart_get_word_length(uart_port_t number, uart_word_length_t *bits) {
    *bits = UART_DATA_8_BITS;
    return ESP_OK;
}

esp_err_t uart_set_parity(uart_port_t number, uart_parity_t parity) {
    return parity == UART_PARITY_DISABLE ? ESP_OK : ESP_ERR_NOT_SUPPORTED;
}

esp_err_t uart_get_parity(uart_port_t number, uart_parity_t *parity) {
    *parity = UART_PARITY_DISABLE;
    return ESP_OK;
}

esp_err_t uart_set_stop_bits(uart_port_t number, uart_stop_bits_t bits) {
    uarts[number].stop_bits = bits == UART_STOP_BITS_2 ? 2 : 1;
    return ESP_OK;
}

esp_err_t uart_get_stop_bits(uart_port_t number, uart_stop_bits_t *bits) {
    *bits = uarts[number].stop_bits == 2 ? UART_STOP_BITS_2 : UART_STOP_BITS_1;
    return ESP_OK;
}

esp_err_t uart_param_config(uart_port_t number, const uart_config_t *config) {
    uart_set_stop_bits(number, config->stop_bits);
    uarts[number].fifo_count = uarts[number].heard_count = 0;
    return uart_set_baudrate(number, config->baud_rate);
}

esp_err_t uart_driver_install(uart_port_t number, int receive, int send, int events, QueueHandle_t *queue, int flags) {
    struct uart *u = &uarts[number];
    if (u->installed || receive <= HARDWARE || (send <= HARDWARE && send)
        || receive > MOST_BUFFER || send > MOST_BUFFER) {
        return ESP_FAIL;
    }
    u->send_size = send;
    u->receive_size = receive;
    u->send_count = u->receive_count = u->items = u->at = u->coming_count = 0;
    u->tx = u->rx = UART_PIN_NO_CHANGE;
    u->installed = true;
    *queue = NULL;
    return ESP_OK;
}

esp_err_t uart_driver_delete(uart_port_t number) {
    struct uart *u = driver(number);
    if (u) {
        u->installed = false;
        u->fifo_count = u->coming_count = 0;
    }
    return ESP_OK;
}

esp_err_t uart_set_pin(uart_port_t number, int tx, int rx, int rts, int cts) {
    if ((tx >= 0 && !GPIO_IS_VALID_OUTPUT_GPIO(tx)) || rx >= GPIO_PIN_COUNT) {
        return ESP_FAIL;
    }
    uarts[number].tx = tx >= 0 ? tx : uarts[number].tx;
    uarts[number].rx = rx >= 0 ? rx : uarts[number].rx;
    return ESP_OK;
}

esp_err_t uart_set_rx_full_threshold(uart_port_t number, int bytes) {
    return driver(number) ? ESP_OK : ESP_ERR_INVALID_STATE;
}

esp_err_t uart_set_rx_timeout(uart_port_t number, uint8_t symbols) {
    return driver(number) ? ESP_OK : ESP_ERR_INVALID_STATE;
}

esp_err_t uart_set_line_inverse(uart_port_t number, uint32_t lines) {
    return lines ? ESP_ERR_NOT_SUPPORTED : ESP_OK;
}

esp_err_t uart_set_hw_flow_ctrl(uart_port_t number, uart_hw_flowcontrol_t lines, uint8_t bytes) {
    return lines ? ESP_ERR_NOT_SUPPORTED : ESP_OK;
}

esp_err_t uart_wait_tx_done(uart_port_t number, TickType_t ticks) {
    struct uart *u = driver(number);
    if (!u) {
        return ESP_FAIL;
    }
    uint64_t end = chip_now + ticks * TICK_NS;
    while (u->fifo_count) {
        if (chip_now >= end) {
            return ESP_ERR_TIMEOUT;
        }
        chip_advance(MIN(end, lines_next()) - chip_now);
    }
    return ESP_OK;
}

esp_err_t uart_get_buffered_data_len(uart_port_t number, size_t *count) {
    struct uart *u = driver(number);
    if (!u) {
        return ESP_FAIL;
    }
    *count = u->receive_count;
    return ESP_OK;
}

int uart_read_bytes(uart_port_t number, void *to, uint32_t count, TickType_t ticks) {
    struct uart *u = driver(number);
    if (!u) {
        return -1;
    }
    uint64_t end = chip_now + ticks * TICK_NS;
    while (u->receive_count < count && chip_now < end) {
        chip_advance(MIN(end, lines_next()) - chip_now);
    }
    count = MIN(count, u->receive_count);
    memcpy(to, u->receive, count);
    memmove(u->receive, u->receive + count, u->receive_count - count);
    u->receive_count -= count;
    return count;
}

// Room in the ring for an item; an item is in one piece, so the worst case is that another's length is left over.
static void send_item(struct uart *u, const uint8_t *from, uint32_t count, uint32_t room) {
    while (u->items + 2 * room > u->send_size) {
        chip_advance(lines_next() - chip_now);
    }
    if (from) {
        memcpy(u->send + u->send_count, from, count);
        u->send_count += count;
    }
    u->items += room;
}

int uart_write_bytes(uart_port_t number, const void *from, size_t count) {
    struct uart *u = driver(number);
    if (!u || !u->send_size) {
        return -1;  // without a ring: not in this model
    }
    uint32_t largest = (u->send_size / 2 - ITEM_HEAD) / 2;
    send_item(u, NULL, 0, room_of(EVENT));
    for (size_t at = 0; at < count; at += largest) {
        uint32_t now = MIN(largest, count - at);
        send_item(u, (const uint8_t *)from + at, now, room_of(now));
        refill(u);
    }
    return count;
}
