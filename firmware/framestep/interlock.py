"""Whether motors may move, what owns them, and whether their drivers are on."""

from array import array

from framestep.protocol import messages as m


class Interlock:
    """Decides which motors may move, and switches their drivers on before they do. No motor starts
    until those have woken up (Axes.wake).

    `flags` has each motor's MOTOR_ bits of CONFIGURE. These have a bit for each motor: `powered`:
    its driver is on; `jogging`; `shooting`: it is on its way to a frame that a button shoots, until
    something stops it or sends it elsewhere; and those of the table of owners below. faults: a
    FaultLog, which is cleared when motors are sent somewhere. broken: the rig file has a mistake,
    so nothing may move. Call join() before the first pass. Nothing allocates after construction.
    """

    def __init__(self, rig, axes, drivers, faults, broken):
        # from the switching on of each motor's driver to its first step, ms; None: no time
        self.enable_ms = None
        times = [rig.motor(i)["enable_ms"] for i in range(axes.count)]
        if max(times):
            self.enable_ms = array("i", times)
        self.resting = None
        times = [rig.motor(i)["off_after_s"] for i in range(axes.count)]
        if max(times):
            from framestep.motors.resting import Resting

            self.resting = Resting(axes, times, isinstance(axes.hal.board.get("enable"), list))
        self.axes = axes
        self.drivers = drivers
        self.faults = faults
        self.broken = broken
        self.flags = array("i", [m.MOTOR_ENABLED] * axes.count)
        self.powered = 0
        self.jogging = 0
        self.homing = 0
        self.shooting = 0
        self.stops = None
        self.operations = None
        self.virtuals = None

    def join(self, stops, operations, virtuals):
        """Set the parts that can use motors. They get this one first, so they are set later."""
        self.stops = stops
        self.operations = operations
        self.virtuals = virtuals

    # ---------------------------------------------------------------- owners of motors
    #
    # The owner of a motor has it to itself, and nothing else may move it:
    #
    #   an operation      `operations.owned`  from GO until all have set out for its end frame
    #   a virtual motion  `virtuals.owned`    from its acknowledgement to its end
    #   homing            `homing`            from its acknowledgement until the motor is done
    #
    # A motor that only moves or jogs has no owner: the next request takes it. Neither has one of an
    # operation that is prepared; `operations.bits` has these as well, for what stops them.

    @property
    def owned(self):
        """Bits of the motors that have an owner."""
        return self.operations.owned | self.virtuals.owned | self.homing

    @property
    def in_virtual_motion(self):
        """Bits of the motors that a virtual motion owns."""
        return self.virtuals.owned

    # ---------------------------------------------------------------- permission

    def allow_motion(self):
        """Return whether any motor may be moved. If a stop has come in the meantime, what moves
        begins to slow down here. The stop itself is carried out after the present request, whose
        motions it stops, too.
        """
        allowed = not self.broken and self.stops.allow_motion()
        self.axes.hal.port.look_for_stop()
        return allowed

    def enabled(self, motor):
        """Return whether a motor may move: it and its partner are enabled, and it is no follower.

        Two coupled motors move one load. While one has no power, the other must not pull at it.
        """
        axis = self.axes[motor]
        if axis.leader or not self.flags[motor] & m.MOTOR_ENABLED:
            return False
        return not axis.partner or self.flags[motor + 1] & m.MOTOR_ENABLED != 0

    def all_enabled(self, bits):
        """Return whether all motors of these bits are enabled()."""
        for motor in range(self.axes.count):
            if (bits >> motor) & 1 and not self.enabled(motor):
                return False
        return True

    def may_move(self, motor):
        """Return OK, or the reason why the motor may not be moved on its own now."""
        if not self.allow_motion():
            return m.ERR_GENERAL
        virtuals = self.virtuals
        if ((self.operations.owned | self.homing) >> motor) & 1:
            return m.ERR_MOVING  # field note 4.9
        if (virtuals.owned >> motor) & 1 and not virtuals.moves_camera(motor):
            return m.ERR_MOVING
        if not self.enabled(motor):
            return m.ERR_GENERAL
        return m.OK if self._drivers_work(1 << motor) else m.ERR_GENERAL

    def may_move_all(self):
        """Return OK, or the reason why no operation may move motors now.

        None may while the driver of any enabled motor does not work: without that motor it would be
        a different move.
        """
        if not self.allow_motion():
            return m.ERR_GENERAL
        if self.drivers and not self._drivers_work(self.with_flag(m.MOTOR_ENABLED)):
            return m.ERR_GENERAL
        return m.ERR_MOVING if self.homing else m.OK  # field note 4.9

    def _drivers_work(self, bits):
        """Return whether the drivers of these motors and of their partners work."""
        drivers = self.drivers
        return not drivers or self.coupled(bits) & ~drivers.ready == 0

    # ---------------------------------------------------------------- before motion

    def prepare(self, bits):
        """Prepare these motors for an operation or a virtual motion."""
        self.stop_jogging(bits)  # other motors go on jogging until their timeout
        self.switch_on(bits)

    def begin_jog(self, bit):
        """Prepare a motor for a jog."""
        self.jogging |= bit
        self.switch_on(bit)

    def begin_shot(self, bits):
        """Note that these motors are on their way to a frame that a button shoots."""
        self.shooting = bits

    def stop_jogging(self, bits=-1):
        """Note that these motors are no longer jogged, or are stopped."""
        self.jogging &= ~bits
        if self.shooting & bits:
            self.shooting = 0

    def set_homing(self, bits):
        """Set which motors are homed, one after the other."""
        self.stop_jogging(bits)
        self.homing = bits

    def switch_on(self, bits):
        """Switch on the drivers of the enabled ones of these motors, which are about to move."""
        self.axes.hal.port.look_for_stop()
        self.faults.clear()
        if self.resting:
            self.resting.begin(bits)
        bits = self.coupled(bits) & self.with_flag(m.MOTOR_ENABLED) & ~self.powered
        if self.drivers:
            bits &= self.drivers.ready
        if bits:
            waking = bits
            if not isinstance(self.axes.hal.board.get("enable"), list):
                # They share a pin: all are switched on with the first of them.
                waking = 0 if self.powered else -1
            self.powered |= bits
            for motor in range(self.axes.count):
                if (bits >> motor) & 1:
                    self.axes.hal.enable(motor, True)
                if self.enable_ms and (waking >> motor) & 1 and self.enable_ms[motor]:
                    self.axes.wake(self.enable_ms[motor])
                self.axes.hal.port.look_for_stop()

    def switch_off_resting(self):
        """Switch off drivers whose motors have been at rest for their `off_after_s`. The positions
        are then HELD. Return whether there were any. To be called at least every second, if
        `resting` is there."""
        used = -1 if self.operations.busy else self.axes.moving_bits() | self.owned
        bits = self.resting.due(self.powered, used, self.virtuals)
        self.switch_off(bits)
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                self.axes.positions.driver_off(motor)
        return bits != 0

    def switch_off(self, bits):
        """Switch off the drivers of these motors."""
        self.powered &= ~bits
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                self.axes.hal.enable(motor, False)

    # ---------------------------------------------------------------- bits of motors

    def coupled(self, bits):
        """Return the bits of these motors and their partners."""
        for motor in range(self.axes.count - 1):
            if (bits >> motor) & 1 and self.axes[motor].partner:
                bits |= 2 << motor
        return bits

    def leading(self, motor):
        """Return the motor that this one follows, or itself."""
        return motor - 1 if self.axes[motor].leader else motor

    def with_flag(self, flag):
        """Return the motors that have a flag set, one bit each."""
        bits = 0
        for motor in range(self.axes.count):
            if self.flags[motor] & flag:
                bits |= 1 << motor
        return bits

    def excluded(self):
        """Return the motors left out of uploaded moves, one bit each.

        They are disabled or under live control, follow another, or have a disabled partner.
        """
        bits = 0
        for motor in range(self.axes.count):
            if not self.enabled(motor) or self.flags[motor] & m.MOTOR_LIVE:
                bits |= 1 << motor
        return bits


class Motion:
    """The motors and what moves them: the interlock, uploaded moves, virtual axes."""

    def __init__(self, axes, interlock, moves, virtuals):
        self.axes = axes
        self.interlock = interlock
        self.moves = moves
        self.virtuals = virtuals
