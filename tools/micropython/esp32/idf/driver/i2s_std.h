// What MicroPython's I2S uses of ESP-IDF.
#pragma once
#include "esp_err.h"
typedef int i2s_port_t;
#define I2S_NUM_AUTO 2
typedef enum { I2S_DIR_RX = 1, I2S_DIR_TX = 2 } i2s_dir_t;
typedef enum { I2S_DATA_BIT_WIDTH_16BIT = 16, I2S_DATA_BIT_WIDTH_32BIT = 32 } i2s_data_bit_width_t;
typedef enum { I2S_SLOT_MODE_MONO = 1, I2S_SLOT_MODE_STEREO = 2 } i2s_slot_mode_t;
#define I2S_ROLE_MASTER 0
#define I2S_STD_SLOT_BOTH 3
#define I2S_GPIO_UNUSED (-1)
typedef struct i2s_channel *i2s_chan_handle_t;
typedef struct { int id, role; uint32_t dma_desc_num, dma_frame_num; bool auto_clear; } i2s_chan_config_t;
#define I2S_CHANNEL_DEFAULT_CONFIG(i, r) { .id = i, .role = r, .dma_desc_num = 6, .dma_frame_num = 240 }
typedef struct { i2s_data_bit_width_t data_bit_width; i2s_slot_mode_t slot_mode; int slot_mask; } i2s_std_slot_config_t;
#define I2S_STD_PHILIPS_SLOT_DEFAULT_CONFIG(b, m) { .data_bit_width = b, .slot_mode = m }
typedef struct { uint32_t sample_rate_hz; } i2s_std_clk_config_t;
#define I2S_STD_CLK_DEFAULT_CONFIG(r) { .sample_rate_hz = r }
typedef struct {
    i2s_std_clk_config_t clk_cfg;
    i2s_std_slot_config_t slot_cfg;
    struct { int mclk, bclk, ws, dout, din; struct { bool mclk_inv, bclk_inv, ws_inv; } invert_flags; } gpio_cfg;
} i2s_std_config_t;
typedef struct { void *data; size_t size; } i2s_event_data_t;
typedef bool (*i2s_isr_callback_t)(i2s_chan_handle_t, i2s_event_data_t *, void *);
typedef struct { i2s_isr_callback_t on_recv, on_recv_q_ovf, on_sent, on_send_q_ovf; } i2s_event_callbacks_t;
esp_err_t i2s_new_channel(const i2s_chan_config_t *, i2s_chan_handle_t *tx, i2s_chan_handle_t *rx);
esp_err_t i2s_channel_init_std_mode(i2s_chan_handle_t, const i2s_std_config_t *);
esp_err_t i2s_channel_register_event_callback(i2s_chan_handle_t, const i2s_event_callbacks_t *, void *);
esp_err_t i2s_channel_enable(i2s_chan_handle_t);
esp_err_t i2s_channel_disable(i2s_chan_handle_t);
esp_err_t i2s_del_channel(i2s_chan_handle_t);
esp_err_t i2s_channel_write(i2s_chan_handle_t, const void *, size_t, size_t *, uint32_t);
esp_err_t i2s_channel_read(i2s_chan_handle_t, void *, size_t, size_t *, uint32_t);
