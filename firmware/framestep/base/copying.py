"""Fast copies of bytes and DWORDs, by words where the alignment allows it. Nothing allocates."""

from array import array

from framestep.base.native import CPYTHON, micropython, ptr8, ptr16, ptr32

if CPYTHON:

    def copy_bytes(to, to_at, source, at, count):
        """Copy `count` bytes from source[at] on to to[to_at] on. Within one buffer it copies only
        toward the front."""
        to[to_at : to_at + count] = source[at : at + count]

    def copy_dwords(words, source, index, at, count):
        """Copy `count` little-endian DWORDs from source[at] on to words[index] on. `at` need not
        be aligned."""
        words[index : index + count] = array("i", bytes(source[at : at + 4 * count]))

else:

    @micropython.viper
    def copy_bytes(to: ptr8, to_at: int, source: ptr8, at: int, count: int):
        # On ARM, viper keeps two locals in registers. Use them for the two addresses: `to` and
        # `to_at`.
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
                    ptr32(to)[0] = (
                        ptr8(to_at)[0] | (ptr16(to_at + 1)[0] << 8) | (ptr8(to_at)[3] << 24)
                    )
                    ptr32(to)[1] = (
                        ptr8(to_at)[4] | (ptr16(to_at + 1)[2] << 8) | (ptr8(to_at)[7] << 24)
                    )
                    to = ptr8(int(to) + 8)
                    to_at += 8
                    count -= 8
            else:
                while count >= 8:
                    ptr32(to)[0] = ptr16(to_at)[0] | (ptr16(to_at)[1] << 16)
                    ptr32(to)[1] = ptr16(to_at)[2] | (ptr16(to_at)[3] << 16)
                    to = ptr8(int(to) + 8)
                    to_at += 8
                    count -= 8
        while count > 0:
            to[0] = ptr8(to_at)[0]
            to = ptr8(int(to) + 1)
            to_at += 1
            count -= 1

    @micropython.viper
    def copy_dwords(words: ptr32, source: ptr8, index: int, at: int, count: int):
        # On ARM, viper keeps the first two parameters in registers: use them for the addresses.
        # For any alignment of the source, most reads are whole words.
        words = ptr32(int(words) + (index << 2))
        at += int(source)
        source = ptr8(at & -4)
        at &= 3
        if at == 0:
            while count >= 4:
                words[0] = ptr32(source)[0]
                words[1] = ptr32(source)[1]
                words[2] = ptr32(source)[2]
                words[3] = ptr32(source)[3]
                words = ptr32(int(words) + 16)
                source = ptr8(int(source) + 16)
                count -= 4
        elif at == 1:
            while count >= 4:
                words[0] = source[1] | (ptr16(source)[1] << 8) | (ptr32(source)[1] << 24)
                words[1] = source[5] | (ptr16(source)[3] << 8) | (ptr32(source)[2] << 24)
                words[2] = source[9] | (ptr16(source)[5] << 8) | (ptr32(source)[3] << 24)
                words[3] = source[13] | (ptr16(source)[7] << 8) | (ptr32(source)[4] << 24)
                words = ptr32(int(words) + 16)
                source = ptr8(int(source) + 16)
                count -= 4
        elif at == 2:
            while count >= 4:
                words[0] = ptr16(source)[1] | (ptr32(source)[1] << 16)
                words[1] = ptr16(source)[3] | (ptr32(source)[2] << 16)
                words[2] = ptr16(source)[5] | (ptr32(source)[3] << 16)
                words[3] = ptr16(source)[7] | (ptr32(source)[4] << 16)
                words = ptr32(int(words) + 16)
                source = ptr8(int(source) + 16)
                count -= 4
        else:
            while count >= 4:
                words[0] = source[3] | (ptr32(source)[1] << 8)
                words[1] = source[7] | (ptr32(source)[2] << 8)
                words[2] = source[11] | (ptr32(source)[3] << 8)
                words[3] = source[15] | (ptr32(source)[4] << 8)
                words = ptr32(int(words) + 16)
                source = ptr8(int(source) + 16)
                count -= 4
        source = ptr8(int(source) + at)
        while count > 0:
            words[0] = source[0] | (source[1] << 8) | (source[2] << 16) | (source[3] << 24)
            words = ptr32(int(words) + 4)
            source = ptr8(int(source) + 4)
            count -= 1
