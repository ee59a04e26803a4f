// The UART of the REPL, at 115200 baud to begin with, as in MicroPython's port for ESP32 (its uart.c and mphalport.c).
//
// Received bytes go into a ring of 260, from an interrupt that also runs while flash is written. If the ring is full,
// they are lost without notice. Sent bytes go into the 128 of the hardware; a write without room there waits for FreeRTOS's
// next tick, of which there are 100 a second.
#include <string.h>
#include "py/mphal.h"
#include "py/ringbuf.h"
#include "py/runtime.h"
#include "py/stream.h"
#include "extmod/misc.h"
#include "shared/runtime/interrupt_char.h"
#include "shared/tinyusb/mp_usbd.h"
#include "shared/tinyusb/mp_usbd_cdc.h"
#include "chip.h"

#define HARDWARE 128
#define MOST (1 << 16)  // bytes from the host that have not arrived yet; and bytes it has not read

bool uart_on;
static uint32_t rate = 115200, host_rate = 115200;
#define BYTE_NS (10000000000ull / rate)  // ten bits

void uart_set_rate(uint32_t baud) {
    rate = baud;
}

uint32_t uart_rate(void) {
    return rate;
}

void uart_set_host_rate(uint32_t baud) {
    host_rate = baud;
}

static uint8_t ring_memory[260];
ringbuf_t stdin_ringbuf = { ring_memory, sizeof ring_memory, 0, 0 };

static uint8_t coming[MOST], gone[MOST];
static uint32_t coming_at, coming_count, gone_count;
static uint64_t next_due;  // when the first of `coming` arrives
static uint64_t free_at;  // when everything written is sent

uint64_t uart_next(void) {
    return coming_count ? next_due : NEVER;
}

void uart_event(void) {
    uint8_t byte = coming[coming_at];
    coming_at = (coming_at + 1) % MOST;
    coming_count--;
    next_due += BYTE_NS;
    if (host_rate != rate) {
        return;
    }
    if (byte == mp_interrupt_char) {
        mp_sched_keyboard_interrupt();
    } else {
        ringbuf_put(&stdin_ringbuf, byte);
    }
}

void uart_receive(const uint8_t *bytes, uint32_t count) {
    if (!coming_count && next_due < chip_now + BYTE_NS) {
        next_due = chip_now + BYTE_NS;
    }
    while (count-- && coming_count < MOST) {
        coming[(coming_at + coming_count++) % MOST] = *bytes++;
    }
}

uint32_t uart_sent(uint8_t *bytes, uint32_t room) {
    uint32_t count = MIN(gone_count, room);
    memcpy(bytes, gone, count);
    memmove(gone, gone + count, gone_count - count);
    gone_count -= count;
    return count;
}

bool uart_has_sent(void) {
    return gone_count > 0;
}

int uart_read(void) {
    for (;;) {
        if (usb_present()) {
            mp_usbd_cdc_poll_interfaces(0);
        }
        int byte = ringbuf_get(&stdin_ringbuf);
        if (byte >= 0) {
            return byte;
        }
        if (board_serves()) {
            board_wait(BYTE_NS);
        } else {
            chip_advance(BYTE_NS);
        }
        mp_handle_pending(true);
    }
}

uintptr_t uart_poll(uintptr_t flags) {
    uintptr_t found = mp_os_dupterm_poll(flags) | (flags & MP_STREAM_POLL_WR);
    if (usb_present()) {
        found |= mp_usbd_cdc_poll_interfaces(flags);
    }
    if (flags & MP_STREAM_POLL_RD && ringbuf_peek(&stdin_ringbuf) != -1) {
        found |= MP_STREAM_POLL_RD;
    }
    return found;
}

void uart_write(const char *text, size_t length) {
    for (size_t i = 0; i < length; i++) {
        while (free_at > chip_now + HARDWARE * BYTE_NS) {
            chip_advance(TICK_NS - chip_now % TICK_NS);
        }
        free_at = MAX(free_at, chip_now) + BYTE_NS;
        if (gone_count < MOST && host_rate == rate) {
            gone[gone_count++] = text[i];
        }
    }
    if (usb_present()) {
        mp_usbd_cdc_tx_strn(text, length);
    }
    mp_os_dupterm_tx_strn(text, length);
}
