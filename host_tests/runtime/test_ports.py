"""The protocol ports on a board with less than an RP2040."""

import pytest


@pytest.mark.parametrize("runtime", ["x86", "xtensa"], indirect=True)  # rv32's has an ESP32's
def test_no_usb_device(runtime):
    """Without machine.USBDevice in MicroPython, the error says what to do."""
    said = runtime.run(
        "try:\n    import framestep.hal.ports.usb_port\nexcept ImportError as error: print(error)"
    )
    assert "machine.USBDevice" in said
    assert '"ports": 1' in said
