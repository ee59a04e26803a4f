"""The contract between the controller and a board. A HAL is an object with

    motors            how many motors
    kernel            motion.stepper.StepKernel, its engine attached and its tick running after start()
    port              the protocol port (below)
    upload_bytes      memory that the uploaded move may take
    start()           begin ticking; called once
    irq_off() -> x    keep the tick away; irq_on(x) lets it come again. For some microseconds only
    ticks_ms()        milliseconds modulo 2^30
    enable(motor, on) the driver's enable pin
    trouble() -> int  TROUBLE_ bits since the last call: what the engine has to say
    idle()            nothing to do: wait for the next interrupt

and a port is one with

    start()           claim the port
    open              whether the host has it open (DTR); True where that cannot be seen
    openings          how often it has been opened; a change means a new host
    poll(reader)      move received bytes into reader.feed(buffer, start, count); returns how many
    send(writer)      begin to send what writer.take(buffer, limit) hands out; never waits

Nothing here allocates after start().
"""

from framestep.native import const

TROUBLE_LOST_COMMAND = const(1)  # a pulse command found its FIFO full: steps are lost
