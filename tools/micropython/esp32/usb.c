// The USB of an ESP32-S3 and the host behind it. MicroPython's own sources run above: its machine.USBDevice, its port for
// the REPL and TinyUSB. This is the controller below TinyUSB (its "dcd"), as TinyUSB's driver for Synopsys' DWC2 treats it
// in slave mode: an interrupt copies each packet. The chip has five endpoints to the host, endpoint 0 among them, and 256
// words for packets.
//
// The host's side: packets at full speed, one every 60 µs, control requests, resets of the bus, the cable. What it asks for
// comes from outside (board.c), where framestep_tools.simulator.usb_host enumerates the device.
#include <stdio.h>
#include <string.h>
#include "py/mphal.h"
#include "py/runtime.h"
#include "tusb.h"
#include "device/dcd.h"
#include "shared/tinyusb/mp_usbd.h"
#include "../bare/files.h"
#include "../bare/host.h"
#include "chip.h"

#define PACKET_NS 60000ull
#define FRAME_NS 1000000ull
#define MOST_IN 5  // endpoints to the host
#define WORDS 256
#define ENDPOINTS 7
#define QUEUED (1 << 16)
#define MOST_WRITES 64

struct endpoint {
    uint16_t size, total, done;
    bool armed, stalled;
    uint8_t *buffer;
};

static struct endpoint endpoints[ENDPOINTS][2];  // [number][1: to the host]
static uint8_t in_count;
static uint16_t words_used;
static bool present, plugged, pulled_up, sof_on;
static uint8_t connections;
static uint64_t next_packet, next_frame;
static uint32_t frame;

// What the host has to send to an endpoint: writes, of which a packet never takes more than one
static struct queue {
    uint8_t bytes[QUEUED];
    uint32_t at, count, writes, lengths[MOST_WRITES];
} queues[ENDPOINTS];
static uint32_t listens;  // endpoints that the host reads, a bit each

// The host's control request
static enum { REST, SETUP, DATA, STATUS } stage;
static uint8_t setup[8], control[4096];
static uint16_t control_at;

static uint8_t told[QUEUED];  // records for the outside: see usb_told()
static uint32_t told_count;

bool usb_present(void) {
    return present;
}

static bool attached(void) {
    return present && plugged && pulled_up;
}

static void tell(uint8_t kind, const uint8_t *bytes, uint16_t count) {
    if (told_count + 3 + count > sizeof told) {
        board_fail("usb: the host does not take what the device sends");
    }
    told[told_count++] = kind;
    told[told_count++] = count;
    told[told_count++] = count >> 8;
    memcpy(told + told_count, bytes, count);
    told_count += count;
}

// Take the records: the endpoint's number and the bytes of a packet; or 0 and the bytes of a control request's answer; or
// 255 for a request that the device has refused.
uint32_t usb_told(const uint8_t **bytes) {
    uint32_t count = told_count;
    *bytes = told;
    told_count = 0;
    return count;
}

bool usb_has_told(void) {
    return told_count > 0;
}

// 0 while the host sees no device; another number each time that it appears
uint8_t usb_state(void) {
    return attached() ? 1 + connections % 255 : 0;
}

// ---------------------------------------------------------------- the host

void usb_plug(bool in) {
    present |= in;
    plugged = in;
    connections++;
    stage = REST;
    memset(queues, 0, sizeof queues);
    listens = 0;
}

void usb_bus_reset(void) {
    if (!attached()) {
        return;
    }
    memset(endpoints, 0, sizeof endpoints);
    endpoints[0][0].size = endpoints[0][1].size = CFG_TUD_ENDPOINT0_SIZE;
    in_count = 1;
    words_used = 13 + 1 + 2 * (CFG_TUD_ENDPOINT0_SIZE / 4 + 1) + 2 * ENDPOINTS + CFG_TUD_ENDPOINT0_SIZE / 4;
    sof_on = false;
    stage = REST;
    dcd_event_bus_reset(0, TUSB_SPEED_FULL, true);
}

void usb_request(const uint8_t *request, const uint8_t *data, uint16_t count) {
    memcpy(setup, request, sizeof setup);
    memcpy(control, data, MIN(count, sizeof control));
    control_at = 0;
    stage = SETUP;
}

void usb_send(uint8_t number, const uint8_t *bytes, uint32_t count) {
    struct queue *q = &queues[number];
    if (q->count + count > QUEUED || q->writes == MOST_WRITES) {
        board_fail("usb: the host sends more than the device takes");
    }
    for (uint32_t i = 0; i < count; i++) {
        q->bytes[(q->at + q->count + i) % QUEUED] = bytes[i];
    }
    q->count += count;
    q->lengths[q->writes++] = count;
}

void usb_listen(uint8_t number, bool on) {
    listens = on ? listens | 1 << number : listens & ~(1 << number);
}

uint32_t usb_queued(uint8_t number) {
    return queues[number].count;
}

void usb_forget(uint8_t number) {
    queues[number].count = queues[number].writes = 0;
}

// ---------------------------------------------------------------- packets

static bool out_waits(int number) {
    return queues[number].writes && endpoints[number][0].armed && !endpoints[number][0].stalled;
}

static bool in_waits(int number) {
    return listens & 1 << number && endpoints[number][1].armed && !endpoints[number][1].stalled;
}

static bool control_waits(void) {
    bool to_host = setup[0] & 0x80;
    if (stage == REST) {
        return false;
    }
    if (stage == SETUP || endpoints[0][0].stalled || endpoints[0][1].stalled) {
        return true;
    }
    return endpoints[0][stage == DATA ? to_host : !to_host].armed;
}

static bool anything_waits(void) {
    for (int i = 1; i < ENDPOINTS; i++) {
        if (out_waits(i) || in_waits(i)) {
            return true;
        }
    }
    return control_waits();
}

uint64_t usb_next(void) {
    if (!attached() || !chip_interrupts) {
        return NEVER;
    }
    uint64_t packet = anything_waits() ? MAX(next_packet, chip_now) : NEVER;
    return MIN(packet, sof_on ? MAX(next_frame, chip_now) : NEVER);
}

static uint16_t take_packet(struct endpoint *e, uint8_t *to) {  // towards the host
    uint16_t count = MIN(e->size, e->total - e->done);
    memcpy(to, e->buffer + e->done, count);
    e->done += count;
    return count;
}

static void put_packet(struct endpoint *e, const uint8_t *from, uint16_t count) {
    if (count > e->total - e->done) {
        board_fail("usb: a packet is larger than the buffer that is left for it");
    }
    memcpy(e->buffer + e->done, from, count);
    e->done += count;
}

static void complete(int number, bool to_host) {
    struct endpoint *e = &endpoints[number][to_host];
    e->armed = false;
    dcd_event_xfer_complete(0, number | (to_host ? 0x80 : 0), e->done, XFER_RESULT_SUCCESS, true);
}

static void control_packet(void) {
    bool to_host = setup[0] & 0x80;
    uint16_t length = setup[6] | setup[7] << 8;
    struct endpoint *e = &endpoints[0][stage == DATA ? to_host : !to_host];
    if (stage == SETUP) {
        endpoints[0][0].armed = endpoints[0][1].armed = endpoints[0][0].stalled = endpoints[0][1].stalled = false;
        stage = length ? DATA : STATUS;
        if (!length) {
            setup[0] &= 0x7f;
        }
        dcd_event_setup_received(0, setup, true);
    } else if (endpoints[0][0].stalled || endpoints[0][1].stalled) {
        stage = REST;
        tell(255, NULL, 0);
    } else if (stage == STATUS) {
        stage = REST;
        tell(0, control, to_host ? control_at : 0);
        complete(0, !to_host);
    } else if (to_host) {
        uint16_t count = take_packet(e, control + control_at);
        control_at += count;
        if (count < e->size || control_at == length) {
            stage = STATUS;
        }
        complete(0, true);
    } else {
        uint16_t count = MIN(e->size, length - control_at);
        put_packet(e, control + control_at, count);
        control_at += count;
        if (control_at == length) {
            stage = STATUS;
        }
        complete(0, false);
    }
}

static void out_packet(int number) {
    struct queue *q = &queues[number];
    struct endpoint *e = &endpoints[number][0];
    uint8_t bytes[64];
    uint16_t count = MIN(e->size, q->lengths[0]);
    for (int i = 0; i < count; i++) {
        bytes[i] = q->bytes[(q->at + i) % QUEUED];
    }
    q->at = (q->at + count) % QUEUED;
    q->count -= count;
    q->lengths[0] -= count;
    if (!q->lengths[0]) {
        memmove(q->lengths, q->lengths + 1, --q->writes * sizeof q->lengths[0]);
    }
    put_packet(e, bytes, count);
    if (count < e->size || e->done == e->total) {
        complete(number, false);
    }
}

static void in_packet(int number) {
    uint8_t bytes[64];
    struct endpoint *e = &endpoints[number][1];
    uint16_t count = take_packet(e, bytes);
    tell(number, bytes, count);
    if (e->done == e->total) {
        complete(number, true);
    }
}

void usb_event(void) {
    static int turn;
    if (sof_on && next_frame <= chip_now) {
        next_frame = chip_now + FRAME_NS;
        dcd_event_sof(0, ++frame & 0x7ff, true);
        return;
    }
    next_packet = chip_now + PACKET_NS;
    if (control_waits()) {
        control_packet();
        return;
    }
    for (int i = 0; i < 2 * ENDPOINTS; i++) {  // each in its turn
        turn = (turn + 1) % (2 * ENDPOINTS);
        int number = turn / 2;
        if (number && (turn & 1 ? in_waits(number) : out_waits(number))) {
            turn & 1 ? in_packet(number) : out_packet(number);
            return;
        }
    }
}

// ---------------------------------------------------------------- below TinyUSB

bool dcd_init(uint8_t port, const tusb_rhport_init_t *init) {
    dcd_connect(port);
    return true;
}

bool dcd_deinit(uint8_t port) {
    return true;
}

void dcd_int_enable(uint8_t port) {
}

void dcd_int_disable(uint8_t port) {
}

void dcd_int_handler(uint8_t port) {
}

void dcd_connect(uint8_t port) {
    connections += !pulled_up;
    pulled_up = true;
}

void dcd_disconnect(uint8_t port) {
    pulled_up = false;
}

void dcd_remote_wakeup(uint8_t port) {
}

void dcd_sof_enable(uint8_t port, bool on) {
    if (on && !sof_on) {
        next_frame = chip_now + FRAME_NS;
    }
    sof_on = on;
}

bool dcd_edpt_xfer(uint8_t port, uint8_t address, uint8_t *buffer, uint16_t total) {
    struct endpoint *e = &endpoints[tu_edpt_number(address)][tu_edpt_dir(address)];
    if (!e->size) {
        board_fail("usb: a transfer on an endpoint that is closed: the chip divides by zero and restarts");
    }
    *e = (struct endpoint) { .size = e->size, .total = total, .buffer = buffer, .armed = true, .stalled = e->stalled };
    return true;
}

bool dcd_edpt_xfer_fifo(uint8_t port, uint8_t address, tu_fifo_t *fifo, uint16_t total) {
    return false;
}

void dcd_set_address(uint8_t port, uint8_t address) {
    dcd_edpt_xfer(port, 0x80, NULL, 0);
}

bool dcd_edpt_open(uint8_t port, tusb_desc_endpoint_t const *descriptor) {
    uint8_t address = descriptor->bEndpointAddress, number = tu_edpt_number(address);
    bool to_host = tu_edpt_dir(address);
    uint16_t size = tu_edpt_packet_size(descriptor);
    if (number >= ENDPOINTS) {
        return false;
    }
    if (to_host) {
        if (in_count == MOST_IN || words_used + (size + 3) / 4 > WORDS) {
            return false;
        }
        in_count++;
        words_used += (size + 3) / 4;
    }
    endpoints[number][to_host] = (struct endpoint) { .size = size };
    return true;
}

void dcd_edpt_close_all(uint8_t port) {
    memset(endpoints + 1, 0, sizeof endpoints - sizeof endpoints[0]);
    in_count = 1;
}

void dcd_edpt_stall(uint8_t port, uint8_t address) {
    struct endpoint *e = &endpoints[tu_edpt_number(address)][tu_edpt_dir(address)];
    e->stalled = true;
    e->armed = false;
}

void dcd_edpt_clear_stall(uint8_t port, uint8_t address) {
    endpoints[tu_edpt_number(address)][tu_edpt_dir(address)].stalled = false;
}

void mp_usbd_port_get_serial_number(char *text) {
    strcpy(text, "7cdfa1e0f00d0000");
}
