"""What the usual drivers need at their step, direction and enable pins, by name. Allocates."""

# The sources are as others quote them: docs/use/drivers.md.
# fmt: off
# name: (pulse_us, setup_us, hold_us, enable_ms, enable_high, source). For boxes with optocouplers
# enable_high is that of a common cathode: see docs/start/wiring.md.
TYPE_SETTINGS = {
    "a4988": (1.0, 0.2, 0.2, 1, False,
        "Allegro, A4988 data sheet: STEP 1 µs high and low, DIR 200 ns before and after, wake-up "
        "1 ms"),
    "drv8825": (1.9, 0.65, 0.65, 2, False,
        "Texas Instruments, SLVSA73: STEP 1.9 µs high and low, DIR 650 ns before and after, "
        "wake-up 1.7 ms"),
    "lv8729": (0.5, 0.5, 0.5, 1, False,
        "onsemi, LV8729V data sheet: STEP 0.5 µs high and low, DIR 0.5 µs before and after; no "
        "figure for enable"),
    "tmc2130": (0.25, 0.02, 0.02, 0, False,
        "Trinamic, TMC2130 data sheet: STEP 100 ns high and low, DIR 20 ns before and after"),
    "tmc2208": (0.25, 0.02, 0.02, 0, False,
        "Trinamic, TMC2202/08/24 data sheet: STEP 100 ns high and low, DIR 20 ns before and after"),
    "tmc2209": (0.25, 0.02, 0.02, 0, False,
        "Trinamic, TMC2209 data sheet: STEP 100 ns high and low, DIR 20 ns before and after"),
    "tmc5160": (0.25, 0.02, 0.02, 0, False,
        "Trinamic, TMC5160 data sheet: STEP 100 ns high and low, DIR 20 ns before and after"),
    "tb6560": (30.0, 15.0, 15.0, 1, False,
        "Toshiba, TB6560AHQ data sheet: CLK 30 µs with the oscillator at 130 kHz (FluidNC issue "
        "668); no figure for DIR, 15 µs is Marlin's"),
    "tb6600": (30.0, 15.0, 15.0, 1, False,
        "Toshiba, TB6600HG data sheet: CLK 2.2 µs, 10 µs after ENABLE; boxes have slow "
        "optocouplers in front, some need 30 µs (laurb9/StepperDriver issue 60)"),
    "dm542": (2.5, 5.0, 5.0, 200, False,
        "Leadshine and StepperOnline, DM542T manual: PUL 2.5 µs high and low, DIR 5 µs before, "
        "ENA 200 ms before DIR; no figure for DIR after PUL"),
    "dm556": (2.5, 5.0, 5.0, 200, False,
        "Leadshine and StepperOnline, DM556T manual: as the DM542T's"),
    "dm860": (2.5, 5.0, 5.0, 200, False,
        "Leadshine and StepperOnline, DM860T manual: as the DM542T's"),
    "cl57t": (2.5, 5.0, 5.0, 500, False,
        "StepperOnline, CL57T manuals: PUL 1 or 2.5 µs, DIR 2 or 5 µs before, ENA 200 ms before "
        "DIR, by version; 500 ms in Leadshine's manuals of others of its kind"),
    "cl86t": (2.5, 5.0, 5.0, 500, False,
        "StepperOnline, CL86T manuals: as the CL57T's"),
}
# fmt: on

KEYS = ("pulse_us", "setup_us", "hold_us", "enable_ms", "enable_high")


def needs(name):
    """Return what a type of driver needs, a dictionary of KEYS; without entries for "other"."""
    return dict(zip(KEYS, TYPE_SETTINGS[name])) if name in TYPE_SETTINGS else {}


def complete(motor, given):
    """Set the keys of a motor that are not given in the file to what its type of driver needs, if
    that is more than their defaults."""
    found = needs(motor["type"])
    for key in found:
        if key not in given:
            motor[key] = max(motor[key], found[key])
