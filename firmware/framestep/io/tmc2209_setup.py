"""Registers of a TMC2209 for the driver settings of the rig file. Loaded to read that file.
Allocates.

Register numbers and fields: the makers' register reference, analogdevicesinc/TMC-API
tmc/ic/TMC2209; formulas: TMC2209 datasheet, "Selecting sense resistors" (current), TPOWERDOWN and
CHOPCONF in its register tables.
"""

_CLOCK_HZ = 12_000_000  # the chip's own, trimmed in the factory
_FULL_SCALE_UV = (320_000, 180_000)  # across the sense resistor, by VSENSE
_INNER_MOHM = 20  # resistance that the chip adds to the sense resistor
_ROOT_2 = 1_414_214  # millionths
_SCALES = 32

_GCONF, _GSTAT, _NODECONF = 0x00, 0x01, 0x03
_IHOLD_IRUN, _TPOWERDOWN, _TPWMTHRS, _TCOOLTHRS, _VACTUAL, _COOLCONF = (
    0x10,
    0x11,
    0x13,
    0x14,
    0x22,
    0x42,
)
_CHOPCONF, _PWMCONF = 0x6C, 0x70
_SGTHRS = 0x40
_LONGEST = (1 << 20) - 1  # TCOOLTHRS

_SPREAD = 1 << 2  # GCONF
# pdn_disable, mstep_reg_select; current not from VREF
_UART_RULES = (1 << 6) | (1 << 7)
_FILTER = 1 << 8  # multistep_filt; not together with dedge (datasheet, CHOPCONF)
# 3·8 bit times before an answer: less is not allowed with several drivers on a wire
_SENDDELAY = 2 << 8
_TOFF = 3
# TBL 24 clocks, HSTRT 5, HEND 0: the makers' values for any motor
_CHOPPER = (2 << 15) | (5 << 4)
_VSENSE = 1 << 17
_MRES = 24
_INTPOL = 1 << 28
_DEDGE = 1 << 29
_IHOLDDELAY = 1 << 16  # 22 ms from one step of current to the next
_PWM = 0xC10D0024  # its value after a reset: automatic scaling and gradient
_FREEWHEEL = 1 << 20


def scale(run_ma, sense_mohm):
    """Return (IRUN, VSENSE) for a run current of `run_ma` mA (RMS) or the next lower one, or None
    if it is out of range.

    I = (IRUN + 1)/32 · full scale / (sense resistor + 20 mΩ) / √2. The lower full scale gives finer
    microsteps.
    """
    for vsense in (1, 0):
        voltage = run_ma * (sense_mohm + _INNER_MOHM) * _ROOT_2
        full_scale = _FULL_SCALE_UV[vsense] * 1_000_000
        if full_scale <= _SCALES * voltage <= _SCALES * full_scale:
            return _SCALES * voltage // full_scale - 1, vsense
    return None


def least_ma(sense_mohm):
    """Return the smallest run current in mA (RMS) with this sense resistor."""
    return -(-_FULL_SCALE_UV[1] * 1_000_000 // (_SCALES * (sense_mohm + _INNER_MOHM) * _ROOT_2))


def most_ma(sense_mohm):
    """Return the greatest run current in mA (RMS) with this sense resistor."""
    return _FULL_SCALE_UV[0] * 1_000_000 // ((sense_mohm + _INNER_MOHM) * _ROOT_2)


def registers(driver):
    """Return register numbers and values in the order of writing, five bytes each.

    driver: a dictionary with the keys of framestep.rig.settings.DRIVER_SETTINGS. Raises ValueError
    for a current out of range.
    """
    found = scale(driver["run_ma"], driver["sense_mohm"])
    if found is None:
        sense = driver["sense_mohm"]
        raise ValueError("%d to %d mA with %d mΩ" % (least_ma(sense), most_ma(sense), sense))
    irun, vsense = found
    ihold = max((irun + 1) * driver["hold_percent"] // 100, 1) - 1
    mres = 8
    while 256 >> mres < driver["microsteps"]:
        mres -= 1
    chopper = (
        _CHOPPER
        | (_VSENSE if vsense else 0)
        | (mres << _MRES)
        | (_INTPOL if driver["interpolate"] else 0)
        | (_DEDGE if driver["both_edges"] else 0)
    )
    rules = (
        _UART_RULES
        | (_SPREAD if driver["mode"] == "spread" else 0)
        | (0 if driver["both_edges"] else _FILTER)
    )
    delay = (driver["hold_delay_ms"] * (_CLOCK_HZ // 1000) + (1 << 17)) >> 18
    listed = (
        (_NODECONF, _SENDDELAY),
        (_CHOPCONF, chopper),  # TOFF 0: the bridges are off, which clears a latched short
        (_GSTAT, 7),  # cleared by ones
        (_GCONF, rules),
        (_VACTUAL, 0),
        (_IHOLD_IRUN, ihold | (irun << 8) | _IHOLDDELAY),
        (_TPOWERDOWN, min(delay, 255)),
        (_TPWMTHRS, 0),
        (_TCOOLTHRS, 0),
        (_COOLCONF, 0),
        (_PWMCONF, _PWM | (_FREEWHEEL if driver["hold_percent"] == 0 else 0)),
        (_CHOPCONF, chopper | _TOFF),
    )
    table = bytearray()
    for register, value in listed:
        table.append(register)
        table.extend(value.to_bytes(4, "big"))
    return bytes(table)


def with_stall(table, threshold, speed, microsteps):
    """Return the same registers with StallGuard on.

    DIAG then reports a stall (SG_RESULT at most twice the threshold, 1 … 255) while the motor is
    faster than two thirds of `speed` (steps/s). Below that, and so at the beginning of a motion,
    the chip cannot detect one. SGTHRS takes the place of COOLCONF, which keeps its value from a
    reset.
    """
    # TSTEP: clocks from one 256th of a full step to the next, so longer at lower velocities
    longest = _CLOCK_HZ * microsteps * 3 // (256 * speed * 2)
    found = bytearray(table)
    for at in range(0, len(found), 5):
        value = None
        if found[at] == _TCOOLTHRS:
            value = min(max(longest, 1), _LONGEST)
        elif found[at] == _COOLCONF:
            found[at] = _SGTHRS
            value = threshold
        if value is not None:
            found[at + 1 : at + 5] = value.to_bytes(4, "big")
    return bytes(found)
