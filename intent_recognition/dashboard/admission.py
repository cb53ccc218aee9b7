# SPDX-License-Identifier: Apache-2.0
"""Checks of who may open the page and who may operate it. No ROS, no viser."""

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
"""Environment variable that sets the token. Other users of the machine cannot read it, as they
could a parameter."""
TOKEN_FORM = re.compile(r"[A-Za-z0-9_-]{16,128}")
IDLE_S = 60.0
"""Time without an action after which another connection may take over as operator [s]."""
_HOST = re.compile(r"(?:\[(?P<number>[0-9A-Fa-f:.]+)\]|(?P<name>[\w.-]+))(?::\d{1,5})?", re.ASCII)
"""A `Host` header: an IPv6 address or a name, and optionally a port."""
_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script>", re.DOTALL | re.IGNORECASE)


def random_token() -> str:
    """A token of 192 random bits, which nobody can guess."""
    return secrets.token_urlsafe(24)


def answers(address: str) -> bool:
    """Whether a page at this address answers within two seconds."""
    try:
        with urlopen(address, timeout=2.0) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


class Admission:
    """Checks the request that opens a page or its connection.

    A request must name this server (`Host`). A request made by a page (`Origin`) must come from
    this server's own page. It must carry the token: first in the address, later in a cookie.

    Args:
        host: address at which the page is served.
        port: port at which the page is served.
        token: token that the address or the cookie must carry.
        names: further names under which the page is reached, such as a reverse proxy's.
    """

    def __init__(self, host: str, port: int, token: str, names: Iterable[str] = ()):
        self._port, self._token = port, token
        self._cookie = f"intent_page_{port}"  # cookies are shared by all ports of a machine
        # other ports may set cookies of any form: search for ours only
        self._ours = re.compile(rf'(?<![^;,\s]){self._cookie}="?([^";,\s]*)')
        own = {host, "localhost", socket.gethostname(), f"{socket.gethostname()}.local", *names}
        self._names = frozenset(name.lower() for name in own)
        self._host = host

    @property
    def address(self) -> str:
        """Address that the operator opens, with the token."""
        host = "127.0.0.1" if self._host in ("", "0.0.0.0", "::") else self._host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}/?token={self._token}"

    @property
    def cookie(self) -> str:
        """The `Set-Cookie` header that stores the token in a browser."""
        return f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"

    def refusal(self, path: str, headers: Mapping[str, list[str]], upgrade: bool) -> str:
        """Why a request is refused, in one sentence; empty if it is admitted.

        Args:
            path: path and query of the request.
            headers: all values of each header, by lower-case name.
            upgrade: whether the request opens a WebSocket; browsers then always send `Origin`.
        """
        host = headers.get("host", [])
        if len(host) != 1 or not self._is_own(host[0]):
            return "This server has another name: use that of the address it logs, or set `names`."
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
        """Whether a `Host` is a known name or an IP address, which DNS rebinding cannot use."""
        if not (found := _HOST.fullmatch(host)):
            return False
        name = (found["number"] or found["name"]).lower()
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        return True


class Operator:
    """The one connection that may operate the page; all others only watch.

    The first connection operates the page until it leaves or does nothing for `IDLE_S`; then the
    next one that acts takes over. Nobody operates a read-only page. `clock` is monotonic [s].
    """

    def __init__(self, read_only: bool = False, clock: Callable[[], float] = time.monotonic):
        self._read_only, self._clock = read_only, clock
        self._who: Hashable | None = None
        self._acted_s = -math.inf
        self._lock = threading.Lock()

    def enter(self, who: Hashable) -> None:
        """Register a new connection."""
        with self._lock:
            if self._who is None:
                self._who, self._acted_s = who, self._clock()

    def leave(self, who: Hashable) -> None:
        """Forget a closed connection."""
        with self._lock:
            if self._who == who:
                self._who = None

    def may_act(self, who: Hashable) -> bool:
        """Whether this connection may act; if so, it is the operator from now on."""
        with self._lock:
            now_s = self._clock()
            free = self._who is None or now_s - self._acted_s > IDLE_S
            if self._read_only or not (free or self._who == who):
                return False
            self._who, self._acted_s = who, now_s
            return True

    @property
    def refusal(self) -> str:
        """Why an onlooker's action was refused. All browsers show it, the operator's too."""
        if self._read_only:
            return "This page is read only."
        free = f"until it closes the page, or rests for {IDLE_S:.0f} s"
        return f"An onlooker's action was not done: one browser operates the page, {free}."


def new_token() -> str:
    """The token in `TOKEN_VARIABLE`, or a new random one.

    Raises:
        ArgumentError: the token in the variable is easy to guess or does not fit in an address.
    """
    token = os.environ.get(TOKEN_VARIABLE) or random_token()
    if not TOKEN_FORM.fullmatch(token):
        expected = "16 to 128 letters, digits, - and _"
        cure = "Unset it: a token is made at each start."
        raise ArgumentError.about(TOKEN_VARIABLE, expected, f"{len(token)} characters", cure)
    return token


def response_headers(scripts: Iterable[str], host: str) -> dict[str, str]:
    """Security headers of every answer: no frames, no other origins, only the page's own scripts.

    `scripts` come from `script_sources`; `host` is the request's, already checked.
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
    """Hashes of the scripts in a page's text; scripts that they insert may run, too."""
    scripts = (hashlib.sha256(text.encode()).digest() for text in _SCRIPT.findall(page))
    return [f"'sha256-{base64.b64encode(digest).decode()}'" for digest in scripts]
