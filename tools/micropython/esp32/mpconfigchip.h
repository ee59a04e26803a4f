// Additions to mpconfigport.h for the chip.
#undef MICROPY_HW_MCU_NAME
#define MICROPY_HW_MCU_NAME                 "ESP32"
#undef MICROPY_PY_MACHINE
#define MICROPY_PY_MACHINE                  (1)
#define MICROPY_PY_MACHINE_INCLUDEFILE      "../esp32/machine.c"
#define MICROPY_PY_MACHINE_SIGNAL           (0)
#define MICROPY_PY_MACHINE_I2S              (1)
#define MICROPY_PY_MACHINE_I2S_INCLUDEFILE  "ports/esp32/machine_i2s.c"
#define MICROPY_PY_MACHINE_I2S_FINALISER    (1)
#define MICROPY_PY_MACHINE_I2S_CONSTANT_RX  (I2S_DIR_RX)
#define MICROPY_PY_MACHINE_I2S_CONSTANT_TX  (I2S_DIR_TX)
#define MICROPY_PY_MACHINE_PIN_MAKE_NEW     mp_pin_make_new
#define MICROPY_PY_SELECT                   (1)
#define MICROPY_STREAMS_NON_BLOCK           (1)
#define MICROPY_SCHEDULER_DEPTH             (8)
#define MICROPY_HW_ENABLE_UART_REPL         (1)
#define MICROPY_PY_MACHINE_UART             (1)
#define MICROPY_PY_MACHINE_UART_INCLUDEFILE "ports/esp32/machine_uart.c"
#define MICROPY_PY_MACHINE_UART_SENDBREAK   (1)
#define MICROPY_PY_MACHINE_UART_IRQ         (1)
#define MICROPY_PY_MACHINE_PWM              (1)
#define MICROPY_PY_MACHINE_PWM_DUTY         (1)
#define MICROPY_PY_MACHINE_PWM_INCLUDEFILE  "ports/esp32/machine_pwm.c"
#define MICROPY_PY_MACHINE_DISABLE_IRQ_ENABLE_IRQ (1)
#define MICROPY_PY_MACHINE_WDT              (1)
#define MICROPY_PY_MACHINE_WDT_INCLUDEFILE  "ports/esp32/machine_wdt.c"
#define MP_THREAD_GIL_EXIT()
#define MP_THREAD_GIL_ENTER()

// Files in flash, as in the port for ESP32
#define MICROPY_VFS                         (1)
#define MICROPY_READER_VFS                  (1)
#define MICROPY_PY_MACHINE_RESET            (1)
#undef MICROPY_HELPER_REPL
#define MICROPY_HELPER_REPL                 (1)

// USB, as in the port for ESP32-S3
#define MICROPY_SCHEDULER_STATIC_NODES      (1)
#define MICROPY_HW_ENABLE_USBDEV            (1)
#define MICROPY_HW_ENABLE_USB_RUNTIME_DEVICE (1)
#define MICROPY_HW_USB_CDC                  (1)
#define MICROPY_HW_USB_VID                  (0x303A)
#define MICROPY_HW_USB_PID                  (0x4001)
#define MICROPY_HW_USB_MANUFACTURER_STRING  "Espressif Systems"
#define MICROPY_HW_USB_PRODUCT_FS_STRING    "Espressif Device"
#define MICROPY_INTERNAL_WFE(ms)            chip_wait(ms)
void chip_wait(int ms);

// The REPL's UART, as in the port for ESP32
#undef MICROPY_KBD_EXCEPTION
#define MICROPY_KBD_EXCEPTION               (1)
#define MICROPY_PY_OS_DUPTERM               (1)
#define MICROPY_PY_OS_DUPTERM_NOTIFY        (1)
#define MICROPY_PY_OS_INCLUDEFILE           "../esp32/random.c"
#define MICROPY_PY_OS_URANDOM               (1)
