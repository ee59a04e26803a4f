// paint of hal/stream.py in C, for images whose engine is hal/rp2/registers.py: it takes a third of
// the kernel's time, and sixteen motors leave none to spare. The build puts its machine code into a
// function of MicroPython's assembler (framestep_tools/building/machine_code.py).
// host_tests/board/test_pico2_595.py compares its words with the kernel's.

#include <stdint.h>

enum { // pulse/register_engine.py
    COMMANDS = 16,
    CYCLES = 128000,
    WORDS = 250,
    WORD_BITS = 9,
    TICK_US = 1000,
    WIDE_WRAP = 0x3FFFFFFF,
    LONG_AGO = -0x100000,
};

struct motor { // the words of a motor in hal/stream.py, in their order
    struct motor *next;
    uint32_t step, turn;
    const uint32_t *ring;
    uint32_t taken;
    int32_t at, left, period, high, turns, rest, before;
};

struct stream {
    uint32_t levels;
    struct motor *first;
    uint32_t *clock;
    uint32_t lost;
};

int paint(int32_t first, int32_t unused, uint32_t *words, struct stream *stream) {
    (void)unused;
    *stream->clock = (*stream->clock + TICK_US) & WIDE_WRAP;
    const uint32_t levels = stream->levels;
    words += first;
#pragma GCC unroll 10
    for (int i = 0; i < WORDS; i++)
        words[i] = levels;
    uint32_t bit = 1;
    for (struct motor *m = stream->first; m; m = m->next, bit <<= 1) {
        uint32_t put = m->ring[COMMANDS], taken = m->taken;
        int32_t left = m->left, period = m->period, high = m->high, at = m->at, rest = m->rest;
        const uint32_t step = m->step;
        for (int i = 0; i < rest; i++)
            words[i] |= step;
        rest = 0;
        if (((put - taken) & WIDE_WRAP) > COMMANDS) {
            stream->lost |= bit;
            taken = (put - COMMANDS) & WIDE_WRAP;
        }
        for (;;) {
            if (!left) {
                if (taken == put)
                    break;
                uint32_t command = m->ring[taken & (COMMANDS - 1)];
                taken = (taken + 1) & WIDE_WRAP;
                int32_t wider = (command >> 28) << WORD_BITS;
                high = (command >> 28) + 1;
                if (at + wider < 0)
                    at = -wider; // the engine has been idle until now
                left = (command >> 1) & 0x1FF;
                period = (command >> 10) & 0x3FFFF;
                if (!left) {
                    at += period;
                    continue;
                }
                period += wider;
                m->turns = !(stream->levels & m->turn) != !(command & 1);
            }
            if (m->turns) {
                int32_t i = (at >> WORD_BITS) + high; // the last pulse has ended
                if (i >= WORDS)
                    break;
                for (; i < WORDS; i++)
                    words[i] ^= m->turn;
                stream->levels ^= m->turn;
                m->turns = 0;
            }
            if (at + period >= CYCLES)
                break;
            int32_t pulses = (CYCLES - 1 - at) / period;
            if (pulses > left)
                pulses = left;
            left -= pulses;
            if (high == 1) {
                while (pulses--) {
                    at += period;
                    words[at >> WORD_BITS] |= step;
                }
                continue;
            }
            while (pulses--) {
                at += period;
                int32_t i = at >> WORD_BITS, end = i + high;
                if (end > WORDS) {
                    rest = end - WORDS;
                    end = WORDS;
                }
                for (; i < end; i++)
                    words[i] |= step;
            }
        }
        at -= CYCLES;
        m->at = at < LONG_AGO ? LONG_AGO : at;
        m->taken = taken;
        m->left = left;
        m->period = period;
        m->high = high;
        m->rest = rest;
    }
    return 0; // the assembler's function returns it, and a large number would take memory
}
