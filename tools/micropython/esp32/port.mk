# An ESP32's I2S, timers and pins: MicroPython's own bindings for them, unchanged, on a chip simulated in virtual time.
PORT_INC += -I../esp32/idf -idirafter $(TOP)/ports/esp32
CFLAGS += -DCHIP_ESP32=1 -DCONFIG_IDF_TARGET_ESP32=1
CHIP_SRC_C = chip.c i2s.c timers.c pins.c uart.c lines.c pwm.c watchdog.c board.c flash.c boot.c
CHIP_O = $(addprefix $(BUILD)/chip/, $(CHIP_SRC_C:.c=.o)) $(BUILD)/ports/esp32/machine_timer.o $(BUILD)/ports/esp32/machine_pin.o \
	$(BUILD)/ports/esp32/esp32_partition.o $(BUILD)/shared/runtime/mpirq.o $(BUILD)/shared/runtime/interrupt_char.o $(BUILD)/shared/runtime/pyexec.o \
	$(BUILD)/shared/readline/readline.o
SRC_QSTR += $(addprefix ../esp32/, $(CHIP_SRC_C)) ports/esp32/machine_timer.c ports/esp32/machine_pin.c \
	ports/esp32/esp32_partition.c shared/readline/readline.c shared/runtime/mpirq.c

$(BUILD)/chip/%.o: ../esp32/%.c
	$(ECHO) "CC $<"
	$(Q)$(MKDIR) -p $(dir $@)
	$(Q)$(CC) $(CFLAGS) -c -o $@ $<
