"""Servers that run in threads of their own, for tests that use them from outside."""

import asyncio
import functools
import http.server
import threading

from framestep_tools.client.open_port import open_port
from framestep_tools.console.board_requests import BoardWork
from framestep_tools.console.device import ConsoleDevice
from framestep_tools.console.server import ConsoleServer

PATIENCE_S = 100  # the answer comes at once, but a busy computer may need time


class LoopThread:
    """A loop of asyncio in a thread."""

    def __init__(self):
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def call(self, coroutine):
        """Return what a coroutine returns in that loop."""
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(PATIENCE_S)

    def close(self):
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


class Console(LoopThread):
    """The console's server for a device; `url` is the address of its page."""

    def __init__(self, url, work=None):
        super().__init__()
        self.server = self.call(self._make(url, work))
        self.url = self.server.url

    async def _make(self, url, work):
        device = ConsoleDevice(lambda: open_port(url, 1.0), url, work or BoardWork(None, url))
        device.silence_s = PATIENCE_S  # nothing here is silent on purpose
        server = ConsoleServer(device)
        await server.start()
        return server

    def close(self):
        try:
            self.call(self.server.stop())
        finally:
            super().close()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class FileServer:
    """Serves a folder and nothing more; `url` is its address."""

    def __init__(self, folder):
        handler = functools.partial(_Quiet, directory=folder)
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self):
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()
