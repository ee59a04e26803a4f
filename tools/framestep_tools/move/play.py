"""`framestep play`: play an uploaded move from the pre-roll to rest."""

from collections.abc import Iterable

from ..client.client import Client, Event
from ..client.state import Stopped, is_stopped, too_steep, why_stopped
from ..payloads import Positions, RtEnd, RtGo, RtRunMove
from .move_display import MoveDisplay

_ENDLESS = float("inf")


def play(client: Client, run: RtRunMove, motors: Iterable[int], display: MoveDisplay) -> None:
    """Run the uploaded move of these motors, and wait until they rest on the end frame.

    A loop ends only when something stops it. Raises Stopped, with the reason, if another run ends
    before its last frame, and RequestRefused (client.py).
    """
    reached = run.start_frame * 1000

    def show(event: Event) -> None:
        nonlocal reached
        if isinstance(event.message, Positions):
            reached = event.message.move_time
        display.show(event)

    client.events.clear()  # forget earlier stops
    try:
        client.on_event = display.show
        display.phase("to the pre-roll")
        client.request(run)
        if steep := too_steep(client):
            display.warn(steep)
        client.wait_idle(timeout_s=_ENDLESS)
        display.phase("running")
        client.on_event = show
        client.request(RtGo())
        client.wait_event(RtEnd, timeout_s=_ENDLESS)
        client.on_event = display.show
        display.phase("to the end frame")
        client.wait_idle(timeout_s=_ENDLESS)
    finally:
        client.on_event = None
    if reached != run.end_frame * 1000 or is_stopped(client, motors):
        raise Stopped(
            f"the run ended at frame {reached / 1000:.3f}, before {run.end_frame}: "
            f"{why_stopped(client)}"
        )
