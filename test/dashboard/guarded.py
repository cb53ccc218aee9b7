# SPDX-License-Identifier: Apache-2.0
"""A page that is opened as a browser opens it, well behaved or not."""

import asyncio
import http.client
import time
from contextlib import contextmanager

import msgspec
import viser
from dashboard.browser import TOKEN, free_port
from websockets.asyncio.client import connect

from intent_recognition.dashboard.admission import Admission, Operator
from intent_recognition.dashboard.server import serve_page

CAMERA = {"type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 0.0, 0.0]}
CAMERA |= {"fov": 1.0, "near": 0.1, "far": 10.0, "image_height": 10, "image_width": 10}
CAMERA |= {"look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0]}


def update(control, value, **changed):
    """What a browser sends when a person changes a control."""
    updates = {"value": value}
    return {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": updates} | changed


async def send(connection, *messages):
    for message in messages:
        await connection.send(msgspec.msgpack.encode(message))


class Visited:
    """A page at a port of this machine."""

    def __init__(self, port):
        self.port = port

    @property
    def cookie(self):
        return f"intent_page_{self.port}={TOKEN}"

    def headers(self, changed, **own):
        """The cookie and others, but for what is changed; None leaves one out."""
        given = own | {"Cookie": self.cookie}
        given |= {name.replace("_", "-"): value for name, value in changed.items()}
        return {name: value for name, value in given.items() if value is not None}

    def get(self, path="/", **changed):
        """Status, headers and text of a page."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.putrequest("GET", path, skip_host=True)
        for name, value in self.headers(changed, Host=f"127.0.0.1:{self.port}").items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        try:
            return answer.status, answer.headers, answer.read().decode()
        finally:
            connection.close()

    def connect(self, **changed):
        """A connection as that of a page."""
        return connect(
            f"ws://127.0.0.1:{self.port}",
            subprotocols=[f"viser-v{viser.__version__}"],
            additional_headers=self.headers(changed, Origin=f"http://127.0.0.1:{self.port}"),
            max_size=None,
        )

    async def enter(self, connection):
        await send(connection, CAMERA)


class Guarded(Visited):
    """A served page with one button, and what came of it."""

    def __init__(self, port, server, refused):
        super().__init__(port)
        self.server, self.refused, self.pressed = server, refused, []
        self.button = server.gui.add_checkbox("press", False)
        self.button.on_update(lambda event: self.pressed.append(event.client_id))

    async def press(self, connection, value):
        await send(connection, update(self.button, value))


@contextmanager
def guarded(clock=time.monotonic, **options):
    port, refused = free_port(), []
    parts = Admission("127.0.0.1", port, TOKEN), Operator(clock=clock), refused.append
    server = serve_page("127.0.0.1", port, "test", *parts, **options)
    try:
        yield Guarded(port, server, refused)
    finally:
        server.stop()


async def eventually(condition, within_s=20.0):
    """Wait, letting the connections go on."""
    end = asyncio.get_running_loop().time() + within_s
    while not condition():
        assert asyncio.get_running_loop().time() < end
        await asyncio.sleep(0.01)
