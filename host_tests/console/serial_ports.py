"""Ports of Web Serial for a page without a server: they lead to a board's ports through WebSockets,
and the page does not notice."""

import asyncio
import contextlib

from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosed

from host_tests.served import FileServer, LoopThread

# The user chooses these ports one after another
_PORTS = """addresses => {
    class Port {
        constructor(address) { this.address = address; }
        async open({baudRate}) {
            this.baudRate = baudRate;
            if (this.socket) throw new Error('the port is already open');
            this.socket = new WebSocket(this.address);
            this.socket.binaryType = 'arraybuffer';
            await new Promise((resolve) => this.socket.addEventListener('open', resolve, {once: true}));
            this.readable = new ReadableStream({
                start: (to) => {
                    this.socket.onmessage = ({data}) => to.enqueue(new Uint8Array(data));
                    this.socket.onclose = () => { try { to.close(); } catch { /* cancelled */ } };
                },
            });
            this.writable = new WritableStream({write: (data) => this.socket.send(data)});
        }
        async setSignals(signals) { this.signals = signals; }
        async close() {
            const {socket} = this;
            const closed = new Promise((resolve) => socket.addEventListener('close', resolve, {once: true}));
            socket.close();
            if (socket.readyState !== WebSocket.CLOSED) await closed;
            this.socket = null;
        }
    }
    window.ports = addresses.map((address) => new Port(address));
    let next = 0;
    Object.defineProperty(navigator, 'serial', {configurable: true, value: {
        requestPort: async () => window.ports[next++],
    }});
}"""  # noqa: E501


class SavedPage:
    """The page as `framestep console --save` writes it, or as `make` does, on a web server that
    only serves files; `url` is its address. `give_ports` leads a page's ports to TCP addresses,
    HOST:PORT."""

    def __init__(self, folder, make):
        make(folder)
        self._files = FileServer(folder)
        self.url = self._files.url
        self._loop = LoopThread()
        self._wires = self._loop.call(self._serve())
        self._port = self._wires.sockets[0].getsockname()[1]

    async def _serve(self):
        return await serve(self._carry, "127.0.0.1", 0, compression=None)

    async def _carry(self, page):
        host, port = page.request.path.lstrip("/").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))

        async def back():
            with contextlib.suppress(ConnectionClosed, OSError):
                while data := await reader.read(4096):
                    await page.send(data)
            await page.close()

        task = asyncio.ensure_future(back())
        with contextlib.suppress(ConnectionClosed, OSError):
            async for message in page:
                writer.write(message)
        writer.close()
        await task

    def give_ports(self, page, *addresses):
        page.evaluate(_PORTS, [f"ws://127.0.0.1:{self._port}/{address}" for address in addresses])

    def close(self):
        async def end():
            self._wires.close()
            await self._wires.wait_closed()

        self._loop.call(end())
        self._loop.close()
        self._files.close()
