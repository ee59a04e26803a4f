"""Copies bytes as fast as the runtime can: by words where both places allow it."""

from framestep.native import CPYTHON, micropython, ptr8, ptr16, ptr32

if CPYTHON:

    def copy_bytes(to, to_at, source, at, count):
        """Copy `count` bytes from source[at] on to to[to_at] on; in one buffer only towards its front."""
        to[to_at : to_at + count] = source[at : at + count]

else:

    @micropython.viper
    def copy_bytes(to: ptr8, to_at: int, source: ptr8, at: int, count: int):
        # The two registers that viper has for locals on ARM hold the two places: `to` is the one, `to_at` the other.
        to = ptr8(int(to) + to_at)
        to_at = int(source) + at
        if count >= 16:
            while int(to) & 3:
                to[0] = ptr8(to_at)[0]
                to = ptr8(int(to) + 1)
                to_at += 1
                count -= 1
            if to_at & 3 == 0:
                while count >= 16:
                    ptr32(to)[0] = ptr32(to_at)[0]
                    ptr32(to)[1] = ptr32(to_at)[1]
                    ptr32(to)[2] = ptr32(to_at)[2]
                    ptr32(to)[3] = ptr32(to_at)[3]
                    to = ptr8(int(to) + 16)
                    to_at += 16
                    count -= 16
            elif to_at & 1:
                while count >= 8:
                    ptr32(to)[0] = ptr8(to_at)[0] | ptr16(to_at + 1)[0] << 8 | ptr8(to_at)[3] << 24
                    ptr32(to)[1] = ptr8(to_at)[4] | ptr16(to_at + 1)[2] << 8 | ptr8(to_at)[7] << 24
                    to = ptr8(int(to) + 8)
                    to_at += 8
                    count -= 8
            else:
                while count >= 8:
                    ptr32(to)[0] = ptr16(to_at)[0] | ptr16(to_at)[1] << 16
                    ptr32(to)[1] = ptr16(to_at)[2] | ptr16(to_at)[3] << 16
                    to = ptr8(int(to) + 8)
                    to_at += 8
                    count -= 8
        while count > 0:
            to[0] = ptr8(to_at)[0]
            to = ptr8(int(to) + 1)
            to_at += 1
            count -= 1
