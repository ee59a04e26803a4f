"""A console in a real browser: Chromium without a window, the page's own server, and a simulated or
emulated device behind it."""

import contextlib
import shutil
import threading
import time

import pytest
from playwright.sync_api import sync_playwright

from framestep_tools.client.client import BrokenOff, Client
from framestep_tools.console import page_files
from framestep_tools.console.axes_text import AxesText
from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.serve import Server
from host_tests.console import looking
from host_tests.console.serial_ports import SavedPage
from host_tests.served import PATIENCE_S, Console, FileServer

_LOOK_S = 0.02
_SLICE_NS = 10_000_000  # a board in real time takes a fifth of the time that it takes by 1 ms
PATIENCE_MS = PATIENCE_S * 1000
_BROWSERS = (
    "chromium-headless-shell",  # takes half of the time of the others
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
)
# To draw each frame of a screen takes a fifth of the time of these tests.
_SELDOM_DRAWN = """const drawn = window.requestAnimationFrame;
    window.requestAnimationFrame = (draw) => setTimeout(() => drawn(draw), 80);"""
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip


def browser_program() -> str:
    """Return the installed browser; without one, fail and say what to install."""
    found = next((path for name in _BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.fail("no Chromium is installed: make chromium does it", pytrace=False)
    return found


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=browser_program(), args=FLAGS)
        yield started
        started.close()


class Device:
    """A board that runs in a thread; its protocol's port is on a pseudo-terminal, `path`, and on
    TCP, `tcp`; its REPL likewise. `at_board(f)` calls f(board) in that thread."""

    def __init__(self, board, speed, repl=False):
        board.slice_ns = max(board.slice_ns, _SLICE_NS)
        repl_tcp = "127.0.0.1:0" if repl else None
        self._server = Server(board, speed, tcp="127.0.0.1:0", repl=repl, repl_tcp=repl_tcp)
        reported = [line.split()[-1] for line in self._server.announcements]
        self.path, self.tcp = reported[:2]
        self.url = f"socket://{self.tcp}"
        self.repl, self.repl_tcp = reported[2:] or (None, None)
        self._calls = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._server.stopping:
            while self._calls:
                call, done = self._calls.pop(0)
                call(self._server.board)
                done.set()
            self._server.step()
        self._server.close()

    def at_board(self, call):
        done = threading.Event()
        self._calls.append((call, done))
        assert done.wait(PATIENCE_S)

    @contextlib.contextmanager
    def held(self):
        """Hold the board meanwhile: its ports are open, and nothing answers."""
        go_on = threading.Event()
        holding = threading.Thread(target=self.at_board, args=(lambda _: go_on.wait(),))
        holding.start()
        try:
            yield
        finally:
            go_on.set()
            holding.join()

    def set_pin(self, pin, level):
        self.at_board(lambda board: board._board.set_input(pin, level))

    @contextlib.contextmanager
    def client(self):
        """Yield a client as soon as no other program has the port."""
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                with Client.open(self.url, PATIENCE_S) as client:
                    client.greet()
                    yield client
                return
            except BrokenOff:  # closed at once: the page's server is about to free the port
                assert time.monotonic() < end
                time.sleep(_LOOK_S)

    def close(self):
        self._server.stop()
        self._thread.join()


class Stage:
    """Starts what tests need, and closes everything in reverse order."""

    def __init__(self, browser):
        self._browser = browser
        self._started = contextlib.ExitStack()

    def simulated(self, rig=None, motors=None, speed=1.0, known=False, wired=False):
        """Start a simulated board. known: its motors' positions are; wired: it has the rig file's
        switches."""
        made = SimulatedBoard(rig, motors)
        if wired:
            made.wire_switches()
        if known:
            positions = made.host_board.controller.axes.positions
            for motor in range(positions.count):
                positions.set_known(motor)
        device = Device(made, speed)
        self._started.callback(device.close)
        return device

    def console(self, url, work=None, axes=None):
        """Start the page's server for a device. axes: the path of its axes.toml."""
        served = Console(url, work)
        self._started.callback(served.close)
        if axes:
            served.server.device.axes = AxesText(axes)
        return served

    def opened(self, rig=None, motors=None, speed=1.0, known=False):
        """Return the connected page of a simulated board, and the board."""
        device = self.simulated(rig, motors, speed, known=known)
        return self.connected(self.console(device.url).url), device

    def connected(self, url, **options):
        """Open a page as page() does, and wait until its device has answered."""
        page = self.page(url, **options)
        looking.wait_connected(page)
        return page

    def files(self, folder):
        """Serve a folder; return its address."""
        server = FileServer(folder)
        self._started.callback(server.close)
        return server.url

    def saved(self, folder, make=page_files.save):
        """Serve the page as `framestep console --save` writes it, or as `make` does."""
        saved = SavedPage(folder, make)
        self._started.callback(saved.close)
        return saved

    def closing(self, close):
        """Call this when everything is closed."""
        self._started.callback(close)

    def page(self, url, **options):
        """Open a page; options are a browser context's. `errors` has what went wrong in it, `asked`
        its requests, `sent` its messages to its server."""
        context = self._browser.new_context(
            **{"viewport": {"width": 1280, "height": 900}, **options}
        )
        self._started.callback(context.close)
        context.add_init_script(_SELDOM_DRAWN)
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.errors, page.asked, page.sent = [], [], []
        sent = page.sent
        page.on("websocket", lambda link: link.on("framesent", lambda data: sent.append(data)))
        page.on("pageerror", lambda error: page.errors.append(str(error)))
        page.on("console", lambda said: said.type == "error" and page.errors.append(said.text))
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(url)
        return page

    def close(self):
        self._started.close()


@pytest.fixture
def stage(browser):
    started = Stage(browser)
    yield started
    started.close()


@pytest.fixture(scope="module")
def shared_stage(browser):
    """Yield one stage for all tests of a file: what it starts costs once."""
    started = Stage(browser)
    yield started
    started.close()


@pytest.fixture
def page(opened):
    """Yield the page that a file's tests share, `opened`; each leaves everything at rest."""
    opened.sent.clear()
    yield opened
    looking.wait_rest(opened)
    assert opened.errors == []


@pytest.fixture(scope="module")
def modules(shared_stage):
    """Return a page of the server without a device: only its modules matter."""
    served = shared_stage.console("socket://127.0.0.1:1")
    return shared_stage.page(served.url.replace("/?", "/icon.svg?"))
