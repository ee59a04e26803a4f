// os.urandom: numbers that are the same in each run, but not after a reset.
#include "../esp32/chip.h"

static mp_obj_t mp_os_urandom(mp_obj_t count) {
    static uint64_t state;
    vstr_t bytes;
    vstr_init_len(&bytes, mp_obj_get_int(count));
    for (size_t i = 0; i < bytes.len; i++) {
        state = (state ^ chip_now) * 6364136223846793005ull + 1442695040888963407ull;
        bytes.buf[i] = state >> 56;
    }
    return mp_obj_new_bytes_from_vstr(&bytes);
}
static MP_DEFINE_CONST_FUN_OBJ_1(mp_os_urandom_obj, mp_os_urandom);
