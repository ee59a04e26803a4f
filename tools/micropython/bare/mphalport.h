#include "shared/runtime/interrupt_char.h"

mp_uint_t mp_hal_ticks_ms(void);
mp_uint_t mp_hal_ticks_us(void);
mp_uint_t mp_hal_ticks_cpu(void);
uint64_t mp_hal_time_ns(void);
void mp_hal_delay_ms(mp_uint_t);
void mp_hal_delay_us(mp_uint_t);

#if CHIP_ESP32
#include "../esp32/mphalchip.h"
#endif
