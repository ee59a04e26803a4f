"""The protocol ports where a board has less than an RP2040."""


def test_no_usb_device(runtime):
    """What to do is said where MicroPython has no machine.USBDevice."""
    said = runtime.run(
        "try:\n    import framestep.hal.ports.usb_port\nexcept ImportError as error: print(error)"
    )
    assert "machine.USBDevice" in said
    assert '"ports": 1' in said
