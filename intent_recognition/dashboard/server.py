# SPDX-License-Identifier: Apache-2.0
"""viser's server behind an `Admission`.

viser 1.1 has no hooks to check requests or messages. It serves with
`websockets.asyncio.server.serve`, which documents such hooks (`process_request`,
`process_response`, `create_connection`): `serve_page` fills them in while viser starts, and raises
an error if viser did not call that function.
"""

import asyncio
import logging
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import viser
import websockets.asyncio.server as websockets_server
from websockets import http11
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, ConnectionClosedError, InvalidMessage
from websockets.http11 import Request, Response

from intent_recognition.dashboard.admission import (
    Admission,
    Operator,
    response_headers,
    script_sources,
)
from intent_recognition.dashboard.browser_messages import (
    Action,
    ChangeControl,
    GrabHandle,
    LeaveHandle,
    LookFrom,
    can_become,
    read_message,
)
from intent_recognition.dashboard.welcome import AUTO, NEVER, TOLD, welcome
from intent_recognition.errors import ResourceBusyError, one_line

MOST_CLIENTS, MOST_SOCKETS = 8, 64
"""Largest number of browsers with the page open, and of connections, admitted or not; a browser
opens six."""
SEND_S = 10.0
"""Time after which a browser that reads nothing is disconnected [s]."""
LARGEST_MESSAGE = 2**16
"""Largest message from a browser [bytes]; it sends handle poses and control values."""
LONGEST_LINE = 2**15
"""Longest line of a request [bytes]: one holds all cookies of the host, also other programs'. The
8192 of websockets would lock the operator out beside three of the largest, of 4096."""
WINDOW = 32
"""Number of messages that viser packs into one transmission, which bounds the memory held for a
slow browser; an update of the page has fewer."""
CLIENT = Path(viser.__file__).parent / "client/build/index.html"
_LOGGER = logging.getLogger("intent_recognition.page")


@_LOGGER.addFilter
def _in_one_line(record: logging.LogRecord) -> bool:
    """Log errors without traceback, and failed handshakes at debug level only."""
    error = record.exc_info and record.exc_info[1]
    text = record.getMessage() + (f": {one_line(error)}" if error else "")
    record.msg = text.encode(errors="backslashreplace").decode()  # requests may hold any bytes
    record.args = record.exc_info = record.exc_text = None
    if isinstance(error, (InvalidMessage, ConnectionClosed)):
        record.levelno, record.levelname = logging.DEBUG, "DEBUG"
    return _LOGGER.isEnabledFor(record.levelno)


def serve_page(
    host: str,
    port: int,
    title: str,
    admission: Admission,
    operator: Operator,
    refused: Callable[[str], None],
    light: str = NEVER,
    opened: Callable[[bool], None] = lambda slow: None,
) -> viser.ViserServer:
    """Start a server on exactly this port; viser alone would take the next free one.

    In its thread the server calls `refused` with the reason when it refuses an onlooker's action,
    and `opened` with whether the browser draws slowly when one opens the page with `light` auto.

    Raises:
        ResourceBusyError: the port is taken, the address is not this machine's, or the installed
            viser cannot be guarded.
    """
    _check_free(host, port)
    http11.MAX_LINE_LENGTH = LONGEST_LINE
    page = welcome(light, CLIENT.read_text(encoding="utf-8"))
    opened = opened if light == AUTO else lambda slow: None
    guard = _Guard(admission, operator, refused, page, opened)
    with guard.installed(), redirect_stdout(StringIO()):
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    if not guard.in_place:
        server.stop()
        cure = "Install the viser that requirements.txt names."
        expected = "a server that can be guarded"
        raise ResourceBusyError.about("viser", expected, viser.__version__, cure)
    server._websock_server.get_message_buffer().max_window_size = WINDOW
    guard.page = server
    return server


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            cure = "Choose another port or host."
            raise ResourceBusyError.about(
                "host, port", "an address that is free", f"{host}:{port}, {one_line(error)}", cure
            ) from error


class _Guard:
    """State shared by all connections of one server."""

    def __init__(
        self,
        admission: Admission,
        operator: Operator,
        refused: Callable[[str], None],
        entrance: str,
        opened: Callable[[bool], None],
    ) -> None:
        self.admission, self.operator, self.refused = admission, operator, refused
        self._entrance, self._opened = entrance, opened
        self.sockets: set[ServerConnection] = set()
        self.clients: set[ServerConnection] = set()
        self.in_place = False
        self.page: viser.ViserServer | None = None
        self._scripts = script_sources(entrance)

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Context in which a server that starts is guarded."""
        serve = websockets_server.serve
        guard = self

        class Connection(_Connection):
            _guard = guard

        def guarded(*arguments: Any, **options: Any) -> Any:
            options |= {
                "process_request": guard.answer,
                "process_response": guard.protect,
                "create_connection": Connection,
                "logger": _LOGGER,
                "max_size": LARGEST_MESSAGE,
                "max_queue": 8,
            }
            guard.in_place = True
            return serve(*arguments, **options)

        websockets_server.serve = guarded  # type: ignore[misc,assignment]
        try:
            yield
        finally:
            websockets_server.serve = serve  # type: ignore[misc]

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The response to a request; None to let a browser connect."""
        upgrade = "upgrade" in request.headers
        headers: dict[str, list[str]] = {}
        for name, value in request.headers.raw_items():
            headers.setdefault(name.lower(), []).append(value)
        refusal = self.admission.refusal(request.path, headers, upgrade)
        if refusal:
            return connection.respond(403, f"{refusal}\n")
        if upgrade:
            if len(self.clients) >= MOST_CLIENTS:
                return connection.respond(503, f"{MOST_CLIENTS} browsers have the page open.\n")
            return None
        if request.path in TOLD:
            self._opened(TOLD[request.path])
            return connection.respond(204, "")
        if request.path.partition("?")[0] != "/":
            return connection.respond(404, "The page is one file, at /.\n")
        response = connection.respond(200, self._entrance)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "text/html; charset=utf-8"
        response.headers["Set-Cookie"] = self.admission.cookie
        return response

    def protect(
        self, connection: ServerConnection, request: Request, response: Response
    ) -> Response:
        """Add the security headers to a response, and register an admitted browser."""
        if response.status_code == 101:
            self.clients.add(connection)
            self.operator.enter(connection)
        host = request.headers.get("Host", "") if response.status_code < 400 else "localhost"
        for name, value in response_headers(self._scripts, host).items():
            response.headers[name] = value
        return response

    def can_be_done(self, action: Action, held: set[str]) -> bool:
        """Whether the control or handle acted on is shown and enabled, so that a person can act."""
        if self.page is None:
            return False
        if isinstance(action, ChangeControl):
            control = self.page.gui._gui_input_handle_from_uuid.get(action.uuid)
            if control is None or control.disabled or not control.visible:
                return False
            options = getattr(control, "options", None)
            return can_become(action.updates.value, control.value, options)
        if isinstance(action, LeaveHandle):
            return action.name in held
        handle = self.page.scene._handle_from_transform_controls_name.get(action.name)
        shown = handle is not None and handle.visible
        return shown and (isinstance(action, GrabHandle) or action.name in held)


class _Connection(ServerConnection):
    """A connection that is counted, checks its messages and must be read in time."""

    _guard: _Guard

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count the connection; close it at once if there are too many."""
        self._held: set[str] = set()  # names of the handles being dragged
        self._guard.sockets.add(self)
        super().connection_made(transport)
        if len(self._guard.sockets) > MOST_SOCKETS:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop counting the connection."""
        self._guard.sockets.discard(self)
        self._guard.clients.discard(self)
        self._guard.operator.leave(self)
        super().connection_lost(exc)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message that may have an effect; drop all others."""
        guard = self._guard
        while True:
            data = await super().recv(decode)
            message = read_message(data)
            if isinstance(message, LookFrom):
                return data
            if message is None or not guard.can_be_done(message, self._held):
                continue
            if guard.operator.may_act(self):
                if isinstance(message, GrabHandle):
                    self._held.add(message.name)
                elif isinstance(message, LeaveHandle):
                    self._held.discard(message.name)
                return data
            guard.refused(guard.operator.refusal)

    async def send(self, message: Any, text: bool | None = None) -> None:
        """Send a message, or disconnect a browser that does not read."""
        try:
            await asyncio.wait_for(super().send(message, text), SEND_S)
        except asyncio.TimeoutError:
            self.transport.abort()
            raise ConnectionClosedError(None, None) from None
