"""A client of a device: at its port, or through the program that has the port."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ..axes.rig_axes import Axes
from . import port_finder, shared_port
from .client import DEFAULT_TIMEOUT_S, BrokenOff, Client, NoAnswer, RequestRefused, WrongPort
from .open_port import PortBusy
from .refusals import explain
from .tcp_port import is_socket

_OFFER_S = 0.5  # time for a program that has just opened the port to offer it to others


@contextmanager
def connected(device: str | None, who: str, axes: Axes | None = None) -> Iterator[Client]:
    """Yield a client that has greeted the device, or the only board. who: the program, for others
    that find the port taken; axes: for the client's texts."""
    url = device or port_finder.protocol_port()
    if device and not is_socket(device) and port_finder.is_repl(device):
        right = port_finder.protocol_of(device)
        raise WrongPort(
            f"{device} is the REPL of its board; "
            f"the protocol's port is {right}: name that one, or none"
        )
    with _greeted(url, who) as client:
        client.axes = axes or client.axes
        try:
            yield client
        except RequestRefused as error:
            raise explain(client, error) from None
        finally:
            if client.shared_port:
                client.shared_port.close()


def _greeted(url: str, who: str) -> Client:
    """Return a client that has greeted the device, at its port or through the program that has the
    port."""
    # The program behind a socket closes a second connection, and may not notice it.
    if is_socket(url) and (client := _through(url)):
        return client
    try:
        client = Client.open(url)
        try:
            client.greet()
        except BaseException:
            client.close()
            raise
    except (PortBusy, BrokenOff, NoAnswer) as error:
        if not isinstance(error, PortBusy) and not is_socket(url):
            raise
        end = time.monotonic() + _OFFER_S
        while not (through := _through(url)):
            if time.monotonic() > end:
                raise
            time.sleep(shared_port.LOOK_S)
        return through
    with suppress(OSError):  # then the port is not offered to other programs
        client.shared_port = shared_port.SharedPort(client, url, f"{who} (process {os.getpid()})")
    return client


def _through(url: str) -> Client | None:
    """Return a client through the program that has the device's port, or None if there is none."""
    found = shared_port.find(url)
    port = found and shared_port.enter(found, DEFAULT_TIMEOUT_S)
    if not (found and port):
        return None
    print(f"through {found.who}, which has {url}", file=sys.stderr, flush=True)
    client = Client(port, name=f"{url}, through {found.who}")
    client.greet()
    return client
