// What MicroPython's UART uses of ESP-IDF.
#pragma once
#include "freertos/FreeRTOS.h"
#include "hal/gpio_types.h"

typedef int uart_port_t;
enum { UART_NUM_0, UART_NUM_1, UART_NUM_2, UART_NUM_MAX };
#define SOC_UART_HP_NUM 3
#define SOC_UART_LP_NUM 0
#define UART_HW_FIFO_LEN(number) 128
#define UART_PIN_NO_CHANGE (-1)
enum { UART_SCLK_DEFAULT = 1 };
typedef enum { UART_DATA_5_BITS, UART_DATA_6_BITS, UART_DATA_7_BITS, UART_DATA_8_BITS } uart_word_length_t;
typedef enum { UART_STOP_BITS_1 = 1, UART_STOP_BITS_1_5, UART_STOP_BITS_2 } uart_stop_bits_t;
typedef enum { UART_PARITY_DISABLE = 0, UART_PARITY_EVEN = 2, UART_PARITY_ODD = 3 } uart_parity_t;
typedef enum { UART_HW_FLOWCTRL_DISABLE, UART_HW_FLOWCTRL_RTS, UART_HW_FLOWCTRL_CTS, UART_HW_FLOWCTRL_CTS_RTS } uart_hw_flowcontrol_t;
enum { UART_SIGNAL_RXD_INV = 4, UART_SIGNAL_CTS_INV = 8, UART_SIGNAL_TXD_INV = 32, UART_SIGNAL_RTS_INV = 64 };
typedef struct { enum { UART_DATA, UART_BREAK } type; } uart_event_t;
typedef struct {
    int baud_rate;
    uart_word_length_t data_bits;
    uart_parity_t parity;
    uart_stop_bits_t stop_bits;
    uart_hw_flowcontrol_t flow_ctrl;
    uint8_t rx_flow_ctrl_thresh;
    int source_clk;
} uart_config_t;

esp_err_t uart_param_config(uart_port_t number, const uart_config_t *config);
esp_err_t uart_driver_install(uart_port_t number, int receive, int send, int events, QueueHandle_t *queue, int flags);
esp_err_t uart_driver_delete(uart_port_t number);
esp_err_t uart_set_baudrate(uart_port_t number, uint32_t rate);
esp_err_t uart_get_baudrate(uart_port_t number, uint32_t *rate);
esp_err_t uart_set_word_length(uart_port_t number, uart_word_length_t bits);
esp_err_t uart_get_word_length(uart_port_t number, uart_word_length_t *bits);
esp_err_t uart_set_parity(uart_port_t number, uart_parity_t parity);
esp_err_t uart_get_parity(uart_port_t number, uart_parity_t *parity);
esp_err_t uart_set_stop_bits(uart_port_t number, uart_stop_bits_t bits);
esp_err_t uart_get_stop_bits(uart_port_t number, uart_stop_bits_t *bits);
esp_err_t uart_set_pin(uart_port_t number, int tx, int rx, int rts, int cts);
esp_err_t uart_set_rx_full_threshold(uart_port_t number, int bytes);
esp_err_t uart_set_rx_timeout(uart_port_t number, uint8_t symbols);
esp_err_t uart_set_line_inverse(uart_port_t number, uint32_t lines);
esp_err_t uart_set_hw_flow_ctrl(uart_port_t number, uart_hw_flowcontrol_t lines, uint8_t bytes);
esp_err_t uart_wait_tx_done(uart_port_t number, TickType_t ticks);
esp_err_t uart_get_buffered_data_len(uart_port_t number, size_t *count);
int uart_read_bytes(uart_port_t number, void *to, uint32_t count, TickType_t ticks);
int uart_write_bytes(uart_port_t number, const void *from, size_t count);
