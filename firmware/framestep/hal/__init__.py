"""The contract between the controller and a board. A HAL is an object with

    motors            how many motors
    kernel            motion.kernel.StepKernel, its engine attached and its tick running after start()
    port              the protocol port (below)
    upload_bytes      memory that the uploaded move may take
    start()           begin ticking; called once
    irq_off() -> x    keep the tick away; irq_on(x) lets it come again. For some microseconds only
    ticks_ms()        milliseconds modulo 2^30
    enable(motor, on) the driver's enable pin
    led(colour)       light the board's LED, if there is one, in a colour 0xRRGGBB as far as it has colours; 0: off
    trouble() -> int  motors of which a pulse command was lost since the last call, so steps are missing: a bit each
    reclaim() -> int  give pins that something else has taken their function again. -1 where none was taken, else the
                      motors that may have missed pulses by it: a bit each
    floats            motors whose pins the chip lets go of for a moment after each reset of the USB bus: a bit each
    ready()           False from such a reset on until that moment is over: nothing is to be started
    idle()            nothing to do: wait for the next interrupt

    board             the board's data: boards/<board>/board.json as a dictionary
    output(pin, level) -> bit   make a pin an output; the bit stands for it in drive(). At boot only
    input(pin, pull) -> bit     make a pin an input, pull "up", "down" or "none"; its bit in levels(). At boot only
    drive(high, low)  drive the pins of these bits high and low, all at once; from interrupt handlers too
    levels() -> bits  of the pins that are high, others than inputs as well
    watch(bits, handler)  call handler(x) from a hard interrupt when one of these inputs changes. Once, at boot
    dmx               what puts light levels on a wire (below)
    watchdog          what starts the board again when it is not fed (below)
    wire              the line of the drivers' UART (below), where Rig.drivers is not None
    say(motor, text)  tell in words on the REPL what the driver of a motor (from 1) does, as soon as nothing moves; not
                      where the REPL is the protocol's port
    flash()           storage that outlives a power cut (below); OSError where there is none. At boot only

and a port is one with

    start()           claim the port
    open              whether the host has it open (DTR); True where that cannot be seen
    openings          how often it has been opened; a change means a new host
    poll(reader)      move received bytes into reader.feed(buffer, start, count); returns how many
    send(writer)      begin to send what writer.take(buffer, limit) hands out; never waits. Something true where it is
                      worth while to ask again in the next pass, since something else is still under way

and dmx is one with

    channels          how many, 512, or 0 where there is no DMX
    show(lights)      once a pass: send the levels of an io.lights.Lights on if any has changed

and watchdog is one with

    barked            whether it has started the board this time
    arm(ms)           from now on it is to be fed within so many milliseconds. While the main loop is held up by
                      something else than a pass, and the tick has brought all motors to rest, it feeds itself
    feed()
    disarm()

and wire is one with

    choose(motor)                     the driver of this motor (from 0) is to be talked to; where each has its own line
    send(buffer, count)               put up to 8 bytes on the line; never waits
    receive(buffer, at, limit) -> n   bytes that have come since, at most `limit`, into buffer[at:]; what was sent comes
                                      back as well
and flash is one with

    blocks            how many, at least 2
    bytes             of a block
    read(block, at, buffer)    fill the buffer from a place in a block
    program(block, at, page) -> bool   clear the bits that are 0 in these 256 bytes, `at` being a multiple
    erase(block, page) -> bool         set all bits of a block; page: 256 bytes to work with
                               Both are False where that is not possible.

Nothing here allocates after start().
"""
