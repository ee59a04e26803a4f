"""What several commands have in common: arguments, and Ctrl-C."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..client import Client

STOP_TIME_S = 60.0

Url = Annotated[str, typer.Argument(help="device path or socket://HOST:PORT", metavar="DEVICE", show_default=False)]
Motor = Annotated[int, typer.Argument(help="motor number, from 1", min=1, max=32, show_default=False)]
Steps = Annotated[int, typer.Argument(help="position in steps", min=-(2**31), max=2**31 - 1, show_default=False)]


@contextmanager
def stopping_on_interrupt(client: "Client") -> Iterator[None]:
    """Ctrl-C stops the rig before it ends the command."""
    from ..payloads import MotorStopAll

    try:
        yield
    except KeyboardInterrupt:
        client.request(MotorStopAll())
        client.wait_idle(STOP_TIME_S)
        raise
