# An ESP32's I2S, timers and pins: MicroPython's own bindings for them, unchanged, on a chip simulated in virtual time.
PORT_INC += -I../esp32/idf -idirafter $(TOP)/ports/esp32
PORT_INC += -I$(TOP)/lib/tinyusb/src -I$(TOP)/shared/tinyusb
CFLAGS += -DCHIP_ESP32=1 -DCONFIG_IDF_TARGET_ESP32=1 -DCFG_TUSB_MCU=OPT_MCU_NONE -DTUP_DCD_ENDPOINT_MAX=7
# where an S3 has its PSRAM: addresses are small integers
MEMORY_BASE = 0x3c000000
CHIP_SRC_C = chip.c i2s.c timers.c pins.c uart.c lines.c pwm.c watchdog.c board.c flash.c boot.c usb.c
USB_SRC_C = $(addprefix shared/tinyusb/, mp_usbd.c mp_usbd_cdc.c mp_usbd_descriptor.c mp_usbd_runtime.c) \
	$(addprefix lib/tinyusb/src/, tusb.c common/tusb_fifo.c device/usbd.c device/usbd_control.c class/cdc/cdc_device.c)
CHIP_O = $(addprefix $(BUILD)/chip/, $(CHIP_SRC_C:.c=.o)) $(BUILD)/ports/esp32/machine_timer.o $(BUILD)/ports/esp32/machine_pin.o \
	$(BUILD)/ports/esp32/esp32_partition.o $(BUILD)/shared/runtime/mpirq.o $(BUILD)/shared/runtime/interrupt_char.o $(BUILD)/shared/runtime/pyexec.o \
	$(BUILD)/shared/readline/readline.o $(addprefix $(BUILD)/, $(USB_SRC_C:.c=.o))
SRC_QSTR += $(addprefix ../esp32/, $(CHIP_SRC_C)) ports/esp32/machine_timer.c ports/esp32/machine_pin.c \
	ports/esp32/esp32_partition.c shared/readline/readline.c shared/runtime/mpirq.c shared/tinyusb/mp_usbd_runtime.c extmod/machine_usb_device.c

$(BUILD)/chip/%.o: ../esp32/%.c
	$(ECHO) "CC $<"
	$(Q)$(MKDIR) -p $(dir $@)
	$(Q)$(CC) $(CFLAGS) -c -o $@ $<
