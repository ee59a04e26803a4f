// Partitions of the flash, and those of programs.
#pragma once
#include "esp_err.h"

enum { ESP_PARTITION_TYPE_APP = 0, ESP_PARTITION_TYPE_DATA = 1, ESP_PARTITION_SUBTYPE_ANY = 0xff };
typedef struct {
    int type, subtype;
    uint32_t address, size;
    char label[17];
    bool encrypted;
} esp_partition_t;
typedef const esp_partition_t *esp_partition_iterator_t;

esp_partition_iterator_t esp_partition_find(int type, int subtype, const char *label);
const esp_partition_t *esp_partition_find_first(int type, int subtype, const char *label);
const esp_partition_t *esp_partition_get(esp_partition_iterator_t found);
esp_partition_iterator_t esp_partition_next(esp_partition_iterator_t found);
void esp_partition_iterator_release(esp_partition_iterator_t found);
esp_err_t esp_partition_read(const esp_partition_t *partition, uint32_t offset, void *to, uint32_t count);
esp_err_t esp_partition_write(const esp_partition_t *partition, uint32_t offset, const void *from, uint32_t count);
esp_err_t esp_partition_erase_range(const esp_partition_t *partition, uint32_t offset, uint32_t count);
const esp_partition_t *esp_ota_get_boot_partition(void);
const esp_partition_t *esp_ota_get_running_partition(void);
const esp_partition_t *esp_ota_get_next_update_partition(const esp_partition_t *from);
esp_err_t esp_ota_set_boot_partition(const esp_partition_t *partition);
esp_err_t esp_ota_mark_app_valid_cancel_rollback(void);
