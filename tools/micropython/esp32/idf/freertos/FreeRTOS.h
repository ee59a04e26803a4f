// What MicroPython's I2S and UART use of FreeRTOS.
#pragma once
#include "esp_err.h"

typedef uint32_t TickType_t;
typedef void *QueueHandle_t, *TaskHandle_t;
#define portMAX_DELAY 0xffffffffu
#define pdPASS 1
#define pdTRUE 1
#define pdMS_TO_TICKS(ms) ((ms) / 10)
#define MP_TASK_COREID 1

QueueHandle_t xQueueCreate(int length, int size);
int xQueueSend(QueueHandle_t queue, const void *what, TickType_t ticks);
int xQueueReceive(QueueHandle_t queue, void *what, TickType_t ticks);
void vQueueDelete(QueueHandle_t queue);
int xTaskCreatePinnedToCore(void (*run)(void *), const char *name, int stack, void *argument, int priority,
    TaskHandle_t *task, int core);
void vTaskDelete(TaskHandle_t task);
