"""Response codes and what they mean."""

from enum import IntEnum
from typing import TYPE_CHECKING

from . import codes

if TYPE_CHECKING:
    from typing_extensions import Self


class Ack(IntEnum):
    """Response codes. A code that the specification does not know gets a name such as
    UNKNOWN_0x0042."""

    OK = codes.OK
    ERR_CHECKSUM = codes.ERR_CHECKSUM
    ERR_MOVING = codes.ERR_MOVING
    ERR_UNSUPPORTED = codes.ERR_UNSUPPORTED
    ERR_RANGE = codes.ERR_RANGE
    ERR_GENERAL = codes.ERR_GENERAL
    ERR_NOT_IN_POSITION = codes.ERR_NOT_IN_POSITION
    ERR_PREROLL = codes.ERR_PREROLL
    ERR_POSTROLL = codes.ERR_POSTROLL
    ERR_AIM_COD = codes.ERR_AIM_COD
    ERR_SOFT_UP = codes.ERR_SOFT_UP
    ERR_SOFT_LOW = codes.ERR_SOFT_LOW
    ERR_HARD_UP = codes.ERR_HARD_UP
    ERR_HARD_LOW = codes.ERR_HARD_LOW

    @classmethod
    def _missing_(cls, value: object) -> "Self | None":
        if not isinstance(value, int) or not 0 <= value <= 0xFFFF_FFFF:
            return None
        unknown = int.__new__(cls, value)
        unknown._name_, unknown._value_ = f"UNKNOWN_0x{value:04X}", value
        return unknown

    @property
    def description(self) -> str:
        """What the code means, as text for the user."""
        return _DESCRIPTIONS.get(self, "the specification has no such code")

    @classmethod
    def unpack(cls, data: bytes) -> "Ack":
        """Read a code in either dialect: a WORD, or a DWORD with the code in its low word (field
        note 1.4)."""
        if len(data) not in (2, 4):
            raise ValueError(f"a response code has 2 or 4 bytes, this one has {len(data)}")
        return cls(int.from_bytes(data[:2], "little"))


_DESCRIPTIONS = {
    Ack.OK: "it is done or begun",
    Ack.ERR_CHECKSUM: "it arrived damaged",
    Ack.ERR_MOVING: "something moves that must be at rest",
    Ack.ERR_UNSUPPORTED: "the device does not know it",
    Ack.ERR_RANGE: (
        "there is no such motor, frame or value, "
        "or it needs more velocity or acceleration than is set"
    ),
    Ack.ERR_GENERAL: (
        "E-stop held, motor off, driver failed, rig file wrong, or an earlier request is missing"
    ),
    Ack.ERR_NOT_IN_POSITION: "the motors are not where it begins",
    Ack.ERR_PREROLL: "in the pre-roll a motor would pass a limit, or needs more time",
    Ack.ERR_POSTROLL: "in the post-roll a motor would pass a limit, or needs more time",
    Ack.ERR_AIM_COD: "the aim point is too near",
    Ack.ERR_SOFT_UP: "it leads past the upper soft limit",
    Ack.ERR_SOFT_LOW: "it leads past the lower soft limit",
    Ack.ERR_HARD_UP: "the upper limit switch is hit",
    Ack.ERR_HARD_LOW: "the lower limit switch is hit",
}
