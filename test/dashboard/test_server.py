# SPDX-License-Identifier: Apache-2.0
"""Who is let in, who operates, and what is sent and taken: by a real server."""

import asyncio
import base64
import hashlib
import logging
import os
import resource
import socket

import msgspec
import numpy as np
import pytest
from dashboard.browser import HEIGHT, WIDTH, chromium, free_port
from dashboard.guarded import TOKEN, eventually, guarded
from websockets.exceptions import InvalidStatus

from benchmarks.browser import SEEN, fresh_page, resident_mb
from intent_recognition.dashboard import server as served
from intent_recognition.dashboard.admission import IDLE_S, answers, script_sources
from intent_recognition.dashboard.welcome import ALWAYS, AUTO, LIGHT, NEVER, PLAIN

NEVER_SENT = (
    b"",
    b"\xc1",
    b"\x91" * 5000,
    msgspec.msgpack.encode(["GuiUpdateMessage"]),
    msgspec.msgpack.encode({"type": "Nonsense"}),
    msgspec.msgpack.encode({"type": "ShareUrlRequest"}),
    msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": 3, "updates": []}),
    msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"update_cb": 1}}),
    "text",
)


@pytest.fixture(scope="module")
def page():
    with guarded() as page:
        yield page


def test_the_token_opens_the_page_and_leaves_a_cookie(page):
    assert page.get(Cookie=None)[0] == 403
    status, headers, _ = page.get(f"/?token={TOKEN}", Cookie=None)
    assert status == 200
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
    status, _, text = page.get(Cookie=cookie.split(";")[0])
    assert status == 200
    assert '<div id="root">' in text


def test_large_cookies_of_other_programs_do_not_lock_out(page):
    others = "; ".join(f"other_{k}={'x' * 4000}" for k in range(5))
    ours = page.get(f"/?token={TOKEN}", Cookie=None)[1]["Set-Cookie"].split(";")[0]
    assert page.get(Cookie=f"{others}; {ours}")[0] == 200
    assert page.get(f"/?token={TOKEN}", Cookie=others)[0] == 200
    assert page.get(Cookie=others)[0] == 403


def test_there_is_no_other_file(page):
    for path in ("/x", "/" + 300 * "x", "/..%2f..%2fetc%2fpasswd", "/%00", "//"):
        assert page.get(path)[0] == 404, path


def test_whether_the_page_answers_is_known_by_its_address(page):
    address = f"http://127.0.0.1:{page.port}/?token="
    assert answers(address + TOKEN)
    assert not answers(f"{address}another-token-of-tests")
    assert not answers(f"http://127.0.0.1:{free_port()}/?token={TOKEN}")


@pytest.mark.parametrize("changed", [{"Host": None}, {"Origin": "http://evil.example"}])
def test_strangers_are_refused_and_nothing_of_the_page_is_told(page, changed):
    status, headers, text = page.get(**changed)
    assert status in (400, 403)
    assert TOKEN not in text + str(headers)
    assert "script" not in text


def test_another_page_gets_no_connection(page):
    """Nor may it read the page: test_admission.py."""

    async def attempt():
        async with page.connect(Sec_Fetch_Site="same-site"):
            pass

    with pytest.raises(InvalidStatus) as refused:
        asyncio.run(attempt())
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("changed", [{}, {"Cookie": None}, {"Host": "evil.example"}])
def test_every_answer_forbids_frames_and_foreign_scripts(page, changed):
    _, headers, _ = page.get(**changed)
    policy = dict(rule.split(" ", 1) for rule in headers["Content-Security-Policy"].split("; "))
    assert policy["frame-ancestors"] == policy["default-src"] == "'none'"
    assert "unsafe-inline" not in policy["script-src"]
    assert "unsafe-eval'" not in policy["script-src"].replace("wasm-unsafe-eval", "")
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["X-Content-Type-Options"] == "nosniff"


def test_what_is_no_request_is_told_to_those_who_debug_in_one_line(page, caplog):
    caplog.set_level(logging.DEBUG, "intent_recognition.page")
    probes = (b"", b"\x16\x03\x01\xff\n")
    for raw in probes:
        _answer(page, raw, half_closed=True)

    def levels():
        return [r.levelno for r in caplog.records if "opening handshake failed: " in r.getMessage()]

    asyncio.run(eventually(lambda: len(levels()) >= len(probes)))
    assert levels() == [logging.DEBUG] * len(probes) and "Traceback" not in caplog.text


@pytest.mark.parametrize("half_closed", [False, True])
@pytest.mark.parametrize(
    "raw", [b"/?token=\xff\xfe HTTP/1.1\r\nHost: localhost", b"/ HTTP/1.1\r\nHost: a b"]
)
def test_a_request_of_any_bytes_is_refused(page, caplog, raw, half_closed):
    caplog.set_level(logging.DEBUG, "intent_recognition.page")
    answer = _answer(page, b"GET " + raw + b"\r\n\r\n", half_closed)
    # who has left may get none
    assert answer.startswith(b"HTTP/1.1 403 ") or (half_closed and not answer)
    assert all(record.levelno <= logging.INFO for record in caplog.records)
    assert caplog.text.encode("utf-8")  # a log of any handler takes it


def _answer(page, raw, half_closed=False):
    """What the page answers to bytes."""
    with socket.create_connection(("127.0.0.1", page.port), timeout=20) as probe:
        probe.sendall(raw)
        if half_closed:
            probe.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: probe.recv(4096), b""))


def test_one_operates_until_it_leaves_and_others_look_on():
    async def visit(page):
        async with page.connect() as first:
            await page.enter(first)
            async with page.connect() as second:
                await page.enter(second)
                await page.press(second, True)
                await eventually(lambda: page.refused)
                await page.press(first, True)
                await eventually(lambda: page.pressed)
                assert page.button.value is True
                await first.close()
                await eventually(lambda: len(page.server.get_clients()) == 1)
                await page.press(second, False)
                await eventually(lambda: len(page.pressed) == 2)
                assert len(set(page.pressed)) == 2

    with guarded() as page:
        asyncio.run(visit(page))


def test_an_operator_that_rests_is_followed():
    async def visit(page, clock):
        async with page.connect() as first, page.connect() as second:
            await page.enter(first)
            await page.enter(second)
            clock[0] += IDLE_S + 1.0
            await page.press(second, True)
            await eventually(lambda: page.pressed)
            await page.press(first, False)
            await eventually(lambda: page.refused)

    clock = [0.0]
    with guarded(clock=lambda: clock[0]) as page:
        asyncio.run(visit(page, clock))


def test_what_no_page_sends_has_no_effect(page, capfd):
    async def visit():
        async with page.connect() as connection:
            await page.enter(connection)
            rng = np.random.default_rng(3)
            for data in (*NEVER_SENT, *(rng.bytes(rng.integers(1, 60)) for _ in range(200))):
                await connection.send(data)
            await page.press(connection, True)
            await eventually(lambda: page.pressed)
            with pytest.raises(Exception, match="1009"):
                await connection.send(bytes(served.LARGEST_MESSAGE + 1))
                await connection.recv()
                while True:
                    await connection.recv()

    asyncio.run(visit())
    assert "Traceback" not in capfd.readouterr().err


def test_so_many_browsers_and_no_more(page):
    async def visit():
        opened = [await page.connect() for _ in range(served.MOST_CLIENTS)]
        try:
            with pytest.raises(InvalidStatus) as refused:
                await page.connect()
            assert refused.value.response.status_code == 503
        finally:
            for connection in opened:
                await connection.close()
        await eventually(lambda: not page.server._websock_server._live_connections)
        async with page.connect() as again:
            await page.enter(again)

    asyncio.run(visit())


def test_sockets_that_never_speak_leave_room_for_those_that_do(page):
    silent = [
        socket.create_connection(("127.0.0.1", page.port)) for _ in range(3 * served.MOST_SOCKETS)
    ]
    open_files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    assert open_files > served.MOST_SOCKETS
    for one in silent:
        one.close()

    async def served_again():
        await eventually(_answers)

    def _answers():
        try:
            return page.get()[0] == 200
        except OSError:
            return False

    asyncio.run(served_again())


def test_a_browser_that_does_not_read_is_cut_off_and_holds_little(monkeypatch):
    monkeypatch.setattr(served, "SEND_S", 0.5)

    async def visit(page):
        connections = [await page.connect() for _ in range(4)]
        for connection in connections:
            await page.enter(connection)
            connection.transport.pause_reading()
        before = resident_mb(os.getpid())
        noise = np.random.default_rng(0).normal(size=(20_000, 3)).astype(np.float32)
        for k in range(400):
            page.server.scene.add_point_cloud("/cloud", noise + k, noise)
            await asyncio.sleep(0.005)
            if not page.server._websock_server._live_connections:
                break
        await eventually(lambda: not page.server._websock_server._live_connections)
        assert resident_mb(os.getpid()) - before < 100.0
        for connection in connections:
            connection.transport.abort()

    with guarded() as page:
        asyncio.run(visit(page))


def test_scripts_are_known_by_their_hashes():
    page = "<script data-p='x'>unpack()</script><b></b><script>more()</script>"
    wanted = [
        f"'sha256-{base64.b64encode(hashlib.sha256(one).digest()).decode()}'"
        for one in (b"unpack()", b"more()")
    ]
    assert script_sources(page) == wanted


@pytest.mark.parametrize("light", [AUTO, ALWAYS, NEVER])
def test_the_address_with_the_token_is_a_page_as_light_as_is_wanted(light):
    opened = []
    with guarded(light=light, opened=opened.append) as page:
        _, headers, text = page.get(f"/?token={TOKEN}", Cookie=None)
        first, rest = text.split("</script>", 1)
        assert '<div id="root">' in rest and (light == AUTO) == ("drawArrays" in first)
        assert (f"slow = {light == ALWAYS:d};" in first) == (light != AUTO)
        policy = headers["Content-Security-Policy"]
        assert all(one in policy for one in script_sources(text))
        assert page.get(LIGHT, Cookie=None)[0] == page.get("/light", Cookie=None)[0] == 403
        assert page.get(PLAIN)[0] == page.get(LIGHT)[0] == 200
        assert page.get("/plain")[0] == page.get("/light")[0] == 204
        assert opened == ([False, True] if light == AUTO else [])


@pytest.mark.slow
@pytest.mark.parametrize("light", [ALWAYS, NEVER])
def test_a_light_page_does_not_load_the_light_that_it_will_not_use(light):
    """viser asks for its own as it makes the scene, so before it adds the first node."""
    chromium()
    note = """window.pictures = 0; const before = window.fetch;
    window.fetch = (wanted, given) => {
      window.pictures += String(wanted.url || wanted).startsWith("data:image");
      return before(wanted, given);
    };"""
    with guarded(light=light) as served, fresh_page(WIDTH, HEIGHT) as (_, page):
        served.server.scene.add_frame("/seen")
        page.add_init_script(note)
        page.goto(f"http://127.0.0.1:{served.port}/?token={TOKEN}")
        page.wait_for_function(SEEN, arg="/seen")
        assert page.evaluate("window.pictures") == (light == NEVER)
