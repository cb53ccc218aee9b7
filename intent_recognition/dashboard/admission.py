# SPDX-License-Identifier: Apache-2.0
"""Who may open the page, and who may operate it. No ROS, no viser."""

import base64
import hashlib
import ipaddress
import math
import os
import re
import secrets
import socket
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Mapping
from urllib.parse import unquote
from urllib.request import urlopen

from intent_recognition.errors import ArgumentError

TOKEN_VARIABLE = "INTENT_PAGE_TOKEN"
"""Environment variable that sets the token; a variable is not seen by other users, unlike a
parameter."""
TOKEN_FORM = re.compile(r"[A-Za-z0-9_-]{16,128}")
IDLE_S = 60.0
"""An operator that has done nothing for so long may be followed by another [s]. Convention."""
_HOST = re.compile(r"(?:\[(?P<number>[0-9A-Fa-f:.]+)\]|(?P<name>[\w.-]+))(?::\d{1,5})?", re.ASCII)
"""A `Host`: an address of IPv6 or a name, and a port."""
_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script>", re.DOTALL | re.IGNORECASE)


def random_token() -> str:
    """192 random bits, which cannot be guessed."""
    return secrets.token_urlsafe(24)


def answers(address: str) -> bool:
    """Whether the page answers at its address within two seconds."""
    try:
        with urlopen(address, timeout=2.0) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


class Admission:
    """Checks the request that opens a page or its connection.

    A request must name this server (`Host`), come from its own page if it comes from a page
    (`Origin`), and carry the token: in the address the first time, in a cookie from then on.

    Args:
        host: address the page is served on.
        port: its port.
        token: what the address and the cookie carry.
        names: further names under which the page is reached, such as that of a reverse proxy.
    """

    def __init__(self, host: str, port: int, token: str, names: Iterable[str] = ()):
        self._port, self._token = port, token
        self._cookie = f"intent_page_{port}"  # cookies are shared by all ports of a machine
        # Programs on other ports set cookies of any form: ours is looked for, nothing else is read.
        self._ours = re.compile(rf'(?<![^;,\s]){self._cookie}="?([^";,\s]*)')
        own = {host, "localhost", socket.gethostname(), f"{socket.gethostname()}.local", *names}
        self._names = frozenset(name.lower() for name in own)
        self._host = host

    @property
    def address(self) -> str:
        """What the operator opens."""
        host = "127.0.0.1" if self._host in ("", "0.0.0.0", "::") else self._host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}/?token={self._token}"

    @property
    def cookie(self) -> str:
        """The header that gives a browser its cookie."""
        return f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"

    def refusal(self, path: str, headers: Mapping[str, list[str]], upgrade: bool) -> str:
        """Why a request is refused, in a sentence; empty if it is admitted.

        Args:
            path: path and query of the request.
            headers: all values of each header, by lower-case name.
            upgrade: whether it asks for a connection; a browser then always names its origin.
        """
        host = headers.get("host", [])
        if len(host) != 1 or not self._is_own(host[0]):
            return "This server has another name. Open the address that the dashboard has logged."
        own = {f"{scheme}://{host[0]}".lower() for scheme in ("http", "https")}  # also behind TLS
        if any(origin.lower() not in own for origin in headers.get("origin", [])):
            return "Another page may not use this one."
        site = headers.get("sec-fetch-site", [])
        if upgrade and site and site != ["same-origin"]:
            return "Another page may not use this one."
        cookies = self._ours.findall(";".join(headers.get("cookie", [])))
        if not (self.has_token(path) or any(map(self._is_token, cookies))):
            return (
                "The token is missing or old. Open the address that the dashboard has logged:"
                " it ends in ?token=..."
            )
        return ""

    def has_token(self, path: str) -> bool:
        """Whether the query of a path carries the token."""
        pairs = path.partition("#")[0].partition("?")[2].split("&")
        given = [pair.removeprefix("token=") for pair in pairs if pair.startswith("token=")]
        return bool(given) and all(self._is_token(unquote(token)) for token in given)

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(errors="replace"), self._token.encode())

    def _is_own(self, host: str) -> bool:
        """Whether a `Host` is a known name, or a number, which no name server gives to a page."""
        if not (found := _HOST.fullmatch(host)):
            return False
        name = (found["number"] or found["name"]).lower()
        try:
            if name in self._names:
                return True
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True


class Operator:
    """One connection at a time operates the page; the others look on.

    The first to come operates, until it leaves or has done nothing for `IDLE_S`; then whoever
    acts next does. Nobody operates a page that is read only. The clock is monotonic [s].
    """

    def __init__(self, read_only: bool = False, clock: Callable[[], float] = time.monotonic):
        self._read_only, self._clock = read_only, clock
        self._who: Hashable | None = None
        self._acted_s = -math.inf
        self._lock = threading.Lock()

    def enter(self, who: Hashable) -> None:
        """A connection has come."""
        with self._lock:
            if self._who is None:
                self._who, self._acted_s = who, self._clock()

    def leave(self, who: Hashable) -> None:
        """A connection has gone."""
        with self._lock:
            if self._who == who:
                self._who = None

    def may_act(self, who: Hashable) -> bool:
        """Whether what this connection does is to be done; it operates from then on."""
        with self._lock:
            now_s = self._clock()
            free = self._who is None or now_s - self._acted_s > IDLE_S
            if self._read_only or not (free or self._who == who):
                return False
            self._who, self._acted_s = who, now_s
            return True

    @property
    def refusal(self) -> str:
        """Why an onlooker's action was not done; all browsers show it, the operator's too."""
        if self._read_only:
            return "This page is read only."
        free = f"until it closes the page, or rests for {IDLE_S:.0f} s"
        return f"An onlooker's action was not done: one browser operates the page, {free}."


def new_token() -> str:
    """The token of `TOKEN_VARIABLE`, or a new one.

    Raises:
        ArgumentError: the variable holds something that can be guessed or does not fit an address.
    """
    token = os.environ.get(TOKEN_VARIABLE) or random_token()
    if not TOKEN_FORM.fullmatch(token):
        expected = "16 to 128 letters, digits, - and _"
        cure = "Unset it: a token is made at each start."
        raise ArgumentError.about(TOKEN_VARIABLE, expected, f"{len(token)} characters", cure)
    return token


def response_headers(scripts: Iterable[str], host: str) -> dict[str, str]:
    """Headers of every answer: no frame, no other origin, no script but the page's own.

    The scripts are those of `script_sources`, the host that of the request, which was checked.
    """
    rules = {
        "default-src": "'none'",
        "script-src": " ".join(("'strict-dynamic'", "'wasm-unsafe-eval'", *scripts)),
        "worker-src": "'self' blob:",
        "style-src": "'self' 'unsafe-inline'",
        "img-src": "'self' data: blob:",
        "font-src": "'self' data:",
        "connect-src": f"'self' data: blob: ws://{host} wss://{host}",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    return {
        "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in rules.items()),
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }


def script_sources(page: str) -> list[str]:
    """Hashes of the scripts in the text of a page; what they insert themselves may run, too."""
    scripts = (hashlib.sha256(text.encode()).digest() for text in _SCRIPT.findall(page))
    return [f"'sha256-{base64.b64encode(digest).decode()}'" for digest in scripts]
