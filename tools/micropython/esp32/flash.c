// The flash: a partition for files, `vfs`, as MicroPython makes it behind its own program. Its content is a file of the
// computer. Writing clears bits, erasing a sector sets them; meanwhile no interrupt comes. The times are a common chip's.
#include <string.h>
#include "py/mpconfig.h"
#include "py/misc.h"
#include "esp_ota_ops.h"
#include "../bare/host.h"
#include "chip.h"

#define SECTOR 4096
#define PAGE 256
#define ERASE_NS 45000000ull  // a sector
#define WRITE_NS 700000ull  // a page

uint32_t flash_left = UINT32_MAX;
static int file = -1;
static esp_partition_t files = { .type = ESP_PARTITION_TYPE_DATA, .subtype = 0x81, .address = 0x200000, .label = "vfs" };

bool flash_open(const char *path) {
    file = host_open(path, HOST_UPDATE);
    if (file < 0) {
        return false;
    }
    uint8_t sector[SECTOR];
    while (host_read(file, sector, sizeof sector) == sizeof sector) {
        files.size += sizeof sector;
    }
    return true;
}

// Changes bytes as far as the power lasts.
static void put(uint32_t at, const uint8_t *bytes, uint32_t count) {
    uint32_t now = MIN(count, flash_left);
    host_seek(file, at);
    host_write(file, bytes, now);
    if (flash_left != UINT32_MAX) {
        flash_left -= now;
    }
    if (now < count || flash_left == 0) {
        board_end(STATE_NO_POWER);
    }
}

static bool inside(uint32_t offset, uint32_t count) {
    return offset <= files.size && count <= files.size - offset;
}

// ---------------------------------------------------------------- ESP-IDF

esp_err_t esp_partition_read(const esp_partition_t *partition, uint32_t offset, void *to, uint32_t count) {
    if (!inside(offset, count)) {
        return ESP_ERR_INVALID_ARG;
    }
    host_seek(file, offset);
    return host_read(file, to, count) == (int)count ? ESP_OK : ESP_FAIL;
}

esp_err_t esp_partition_write(const esp_partition_t *partition, uint32_t offset, const void *from, uint32_t count) {
    uint8_t page[PAGE];
    if (!inside(offset, count)) {
        return ESP_ERR_INVALID_ARG;
    }
    while (count) {
        uint32_t now = MIN(count, PAGE - offset % PAGE);
        chip_flash(WRITE_NS);
        esp_partition_read(partition, offset, page, now);
        for (uint32_t i = 0; i < now; i++) {
            page[i] &= ((const uint8_t *)from)[i];
        }
        put(offset, page, now);
        offset += now;
        from = (const uint8_t *)from + now;
        count -= now;
    }
    return ESP_OK;
}

esp_err_t esp_partition_erase_range(const esp_partition_t *partition, uint32_t offset, uint32_t count) {
    static uint8_t erased[SECTOR];
    if (!inside(offset, count) || offset % SECTOR || count % SECTOR) {
        return ESP_ERR_INVALID_ARG;
    }
    memset(erased, 0xFF, sizeof erased);
    for (; count; offset += SECTOR, count -= SECTOR) {
        chip_flash(ERASE_NS);
        put(offset, erased, SECTOR);
    }
    return ESP_OK;
}

esp_partition_iterator_t esp_partition_find(int type, int subtype, const char *label) {
    return type == files.type && (!label || strcmp(label, files.label) == 0) && file >= 0 ? &files : NULL;
}

const esp_partition_t *esp_partition_find_first(int type, int subtype, const char *label) {
    return esp_partition_find(type, subtype, label);
}

const esp_partition_t *esp_partition_get(esp_partition_iterator_t found) {
    return found;
}

esp_partition_iterator_t esp_partition_next(esp_partition_iterator_t found) {
    return NULL;
}

void esp_partition_iterator_release(esp_partition_iterator_t found) {
}

// There is one program, and it is not replaced.
const esp_partition_t *esp_ota_get_boot_partition(void) {
    return NULL;
}

const esp_partition_t *esp_ota_get_running_partition(void) {
    return NULL;
}

const esp_partition_t *esp_ota_get_next_update_partition(const esp_partition_t *from) {
    return NULL;
}

esp_err_t esp_ota_set_boot_partition(const esp_partition_t *partition) {
    return ESP_ERR_NOT_SUPPORTED;
}

esp_err_t esp_ota_mark_app_valid_cancel_rollback(void) {
    return ESP_ERR_NOT_SUPPORTED;
}
