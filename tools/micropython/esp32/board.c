// A whole board, driven by framestep_tools.simulator.esp32_board. Its program is the unchanged firmware; whenever that is
// idle (machine.idle()) or waits for a byte, time goes by, and at the requested time the next commands are read. A command
// is a letter and its arguments, lowest byte first:
//
//     r until[8] output[1] pin[1]   run until this time, ns; with `output`, or until something was sent on the REPL's UART;
//                              or on this TX pin, unless it is 255
//     w count[4] bytes         the host sends bytes
//     p pin[1] level[1]        drive a pin from outside
//     i ns[8]                  the time of a pass from now on
//     s ns[8]                  the main loop pauses, once
//     b rate[4]                the host's rate at the REPL's UART, baud
//     l pin[1] at[8] count[4] bytes   bytes arrive on the RX pin of another UART, from this time on, ns
//     u what[1] …              USB: see usb_command()
//     c bytes[4]               the power is cut when this many bytes of flash have been written or erased
//
// The answer to `r`: the time, ns [8]; whether the chip runs on, restarts or has no more power [1]; the number of bytes
// sent [4], and the bytes; the number of bytes that other UARTs have sent [4], and for each a struct line_byte; the
// state of USB, of usb_state() [1], the number of bytes that the host still has for each of its endpoints 1 to 6 [6 × 4], the
// size of the records of usb_told() [4], and these.
#include <string.h>
#include "py/mphal.h"
#include "py/runtime.h"
#include "../bare/files.h"
#include "../bare/host.h"
#include "chip.h"

#define PASS_NS 500000ull
#define LARGEST 4096

static int commands = -1, answers = -1;
static uint64_t until, pass_ns = PASS_NS, pause_ns;
static uint8_t until_output, until_pin;
int board_reset_cause = 1;  // PWRON_RESET

static void take(void *to, uint32_t count) {
    uint8_t *at = to;
    while (count) {
        int got = host_read(commands, at, count);
        if (got <= 0) {
            host_exit(0);  // the driving program has ended
        }
        at += got;
        count -= got;
    }
}

static void receive(int pin, uint64_t at) {  // pin -1: on the REPL's UART
    static uint8_t bytes[LARGEST];
    uint32_t count;
    take(&count, sizeof count);
    while (count) {
        uint32_t now = MIN(count, sizeof bytes);
        take(bytes, now);
        if (pin < 0) {
            uart_receive(bytes, now);
        } else {
            line_receive(pin, at, bytes, now);
        }
        count -= now;
    }
}

static void answer(uint8_t state) {
    static uint8_t bytes[1 << 16];
    uint32_t count = uart_sent(bytes, sizeof bytes);
    host_write(answers, &chip_now, sizeof chip_now);
    host_write(answers, &state, sizeof state);
    host_write(answers, &count, sizeof count);
    if (count) {
        host_write(answers, bytes, count);
    }
    const struct line_byte *said;
    count = line_said(&said);
    host_write(answers, &count, sizeof count);
    if (count) {
        host_write(answers, said, count * sizeof *said);
    }
    const uint8_t *told;
    uint8_t usb = usb_state();
    host_write(answers, &usb, 1);
    for (int i = 1; i < 7; i++) {
        count = usb_queued(i);
        host_write(answers, &count, sizeof count);
    }
    count = usb_told(&told);
    host_write(answers, &count, sizeof count);
    if (count) {
        host_write(answers, told, count);
    }
    until = 0; // time stops until the next `r`
}

// p in[1]: the cable; r: a reset of the bus; c setup[8] count[2] data: a control request; s endpoint[1] count[4] bytes: the
// host sends; l endpoint[1] on[1]: it reads; f endpoint[1]: it gives up what it has not sent
static void usb_command(void) {
    static uint8_t bytes[LARGEST], letter, two[2], setup[8];
    uint16_t count;
    uint32_t length;
    take(&letter, 1);
    switch (letter) {
        case 'p':
            take(two, 1);
            usb_plug(two[0]);
            break;
        case 'r':
            usb_bus_reset();
            break;
        case 'c':
            take(setup, sizeof setup);
            take(&count, sizeof count);
            take(bytes, count);
            usb_request(setup, bytes, count);
            break;
        case 's':
            take(two, 1);
            take(&length, sizeof length);
            take(bytes, length);
            usb_send(two[0], bytes, length);
            break;
        case 'l':
            take(two, 2);
            usb_listen(two[0], two[1]);
            break;
        case 'f':
            take(two, 1);
            usb_forget(two[0]);
            break;
        default:
            host_exit(2);
    }
}

static void command(void) {
    uint8_t letter, two[2];
    uint32_t number;
    uint64_t time;
    take(&letter, 1);
    switch (letter) {
        case 'r':
            take(&until, sizeof until);
            take(two, 2);
            until_output = two[0];
            until_pin = two[1];
            break;
        case 'w':
            receive(-1, 0);
            break;
        case 'l':
            take(two, 1);
            take(&time, sizeof time);
            receive(two[0], time);
            break;
        case 'b':
            take(&number, sizeof number);
            uart_set_host_rate(number);
            break;
        case 'p':
            take(two, 2);
            pins_drive(two[0], two[1]);
            break;
        case 'i':
            take(&pass_ns, sizeof pass_ns);
            break;
        case 's':
            take(&pause_ns, sizeof pause_ns);
            break;
        case 'u':
            usb_command();
            break;
        case 'c':
            take(&flash_left, sizeof flash_left);
            break;
        default:
            host_exit(2);
    }
}

static bool reached(void) {
    return chip_now >= until || (until_output && (uart_has_sent() || usb_has_told())) || line_has_said(until_pin);
}

void board_wait(uint64_t ns) {
    chip_advance(ns);
    if (reached()) {
        answer(STATE_RUNS);
        do {
            command();
        } while (reached());
    }
}

bool board_serves(void) {
    return commands >= 0;
}

void board_idle(void) {
    if (!board_serves()) {
        return;
    }
    board_wait(pass_ns);
    if (pause_ns) {
        uint64_t ns = pause_ns;
        pause_ns = 0;
        chip_advance(ns);
    }
}

void board_serve(const char *in, const char *out) {
    commands = host_open(in, HOST_READ);
    answers = host_open(out, HOST_WRITE);
    if (commands < 0 || answers < 0) {
        mp_raise_ValueError(MP_ERROR_TEXT("no such file"));
    }
    uart_on = true;
}

void board_fail(const char *why) {
    uart_on = false;  // output goes to the computer again
    mp_hal_stdout_tx_str(why);
    files_flush();
    host_exit(3);
}

void board_end(int state) {
    if (board_serves()) {
        answer(state);
    }
    files_flush();
    host_exit(0);
}

void board_reset(void) {
    board_end(STATE_RESET);
}
