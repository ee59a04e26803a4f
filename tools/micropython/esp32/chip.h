// The simulated chip: its time, its interrupts, and its record.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define NEVER UINT64_MAX
#define TICK_NS 10000000ull  // of FreeRTOS

extern uint64_t chip_now;  // ns since the start
extern bool chip_interrupts;  // false while flash is written: interrupts wait, hardware continues

void chip_advance(uint64_t ns);  // lets time pass; interrupts come when they are due
void chip_flash(uint64_t ns);  // the same without interrupts, which come at its end
void chip_collected(void);  // lets the time of a garbage collection pass

// For each peripheral: when something happens next (at or after now), and what happens then.
uint64_t i2s_next(void);
void i2s_event(void);
void i2s_interrupt(void);  // what waited while interrupts were off
uint64_t timers_next(void);
void timers_event(void);
void timers_interrupt(void);
void pins_interrupt(void);
uint64_t uart_next(void);
void uart_event(void);
uint64_t lines_next(void);
void lines_event(void);
void lines_interrupt(void);
uint64_t pwm_next(void);
void pwm_event(void);
uint64_t watchdog_next(void);
void watchdog_event(void);
uint64_t usb_next(void);
void usb_event(void);
bool pins_drive(unsigned pin, int level);  // drive a pin from outside; false if it does not exist

extern int i2s_record;  // the file's handle, or -1

// The UART of the REPL, when it is on; before that, standard input and output are the computer's.
extern bool uart_on;
void uart_receive(const uint8_t *bytes, uint32_t count);  // the host sends these bytes
uint32_t uart_sent(uint8_t *bytes, uint32_t room);  // takes the bytes sent
bool uart_has_sent(void);
int uart_read(void);  // waits for a byte
uintptr_t uart_poll(uintptr_t flags);
void uart_set_rate(uint32_t rate);
uint32_t uart_rate(void);
void uart_set_host_rate(uint32_t rate);  // bytes get across only while both sides have the same
void uart_write(const char *text, size_t length);

// The other UARTs: see lines.c.
struct line_byte {  // a byte on a TX pin; or the level of a PWM's pin from now on, with 0 bits
    uint64_t first_bit;  // ns
    uint32_t divider;  // a bit takes this many times 25/32 ns
    uint8_t pin, byte, bits, unused;
};
#define LINE_BYTES 8192
void line_edge(int pin, int level);
uint32_t line_said(const struct line_byte **bytes);  // takes the bytes sent
bool line_has_said(int pin);  // since they were taken
void line_receive(int pin, uint64_t first_bit, const uint8_t *bytes, uint32_t count);  // on an RX pin, one after the other

// USB and its host: see usb.c.
bool usb_present(void);  // this chip has USB
uint8_t usb_state(void);
uint32_t usb_told(const uint8_t **bytes);
bool usb_has_told(void);
void usb_plug(bool in);
void usb_bus_reset(void);
void usb_request(const uint8_t *setup, const uint8_t *data, uint16_t count);
void usb_send(uint8_t endpoint, const uint8_t *bytes, uint32_t count);
void usb_listen(uint8_t endpoint, bool on);
uint32_t usb_queued(uint8_t endpoint);
void usb_forget(uint8_t endpoint);

void board_idle(void);  // the main loop has nothing to do: see board.c
bool board_serves(void);  // whether an outside program controls time
void board_wait(uint64_t ns);  // something waits this long for the outside
void board_serve(const char *commands, const char *answers);
enum { STATE_RUNS, STATE_RESET, STATE_NO_POWER, STATE_WATCHDOG };
void board_fail(const char *why) __attribute__((noreturn));  // ends the simulation
void board_end(int state) __attribute__((noreturn));  // the chip stops, and is started again from outside
extern int board_reset_cause;  // as machine.reset_cause() gives it
void board_boot(void *heap, size_t bytes, char **words) __attribute__((noreturn));  // see boot.c

bool flash_open(const char *path);  // see flash.c
extern uint32_t flash_left;  // bytes that can be written or erased before the power is cut
