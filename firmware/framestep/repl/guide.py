"""help(): the commands, with a line each."""


def show():
    """Print the commands with a line each."""
    print(
        """status()      what the controller does, where the motors are, how much can be uploaded
why()         why the motors were stopped, why the last request was refused
watch()       positions, until a key is pressed
trace()       the last requests and answers; the first call begins tracing, trace(0) ends it
move(1, 200)  move motor 1 to step 200
home(1)       home motor 1; home(): all motors that have a home switch
jog()         jog motors by keys; jog(2, 3000): motor 2 first, at 3000 of 10000
stop()        bring all motors to rest
io()          outputs, inputs, switches; io(1, True): output 1 on
timing()      cost of a tick, worst lateness, depth of the queues
rig()         the settings that differ from their defaults
help(x)       MicroPython's help about x"""
    )
