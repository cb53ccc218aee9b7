# SPDX-License-Identifier: Apache-2.0
"""Who is admitted to the page: by our cookie whatever stands beside it, or by the address."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.dashboard.admission import Admission

TOKEN = "A" * 32
OURS = f"intent_page_8080={TOKEN}"
FOREIGN = st.text(st.characters(blacklist_characters=";", max_codepoint=255), max_size=30)


def refusal(path="/", host="127.0.0.1:8080", cookies=(), upgrade=False, **more):
    headers = {"host": [host], "cookie": list(cookies)} | more
    return Admission("127.0.0.1", 8080, TOKEN).refusal(path, headers, upgrade)


@given(before=FOREIGN, after=FOREIGN, apart=st.booleans())
def test_foreign_cookies_of_any_form_do_not_lock_out(before, after, apart):
    cookies = (before, OURS, after)
    assert refusal(cookies=cookies if apart else ["; ".join(cookies)]) == ""
    assert refusal(path=f"/?token={TOKEN}", cookies=[before, after]) == ""


@given(FOREIGN.filter(lambda text: TOKEN not in text))
def test_foreign_cookies_never_admit(foreign):
    assert refusal(cookies=[foreign])


@pytest.mark.parametrize(
    "cookie",
    [f"x{OURS}", f"x-{OURS}", OURS[:-1], f"{OURS}A", f"intent_page_8081={TOKEN}"]
    + ["intent_page_8080=", "intent_page_8080=\udcff", "=;;=, intent"],
)
def test_what_only_resembles_our_cookie_is_refused(cookie):
    assert refusal(cookies=[cookie])


def test_an_old_cookie_of_ours_beside_the_new_one_does_not_lock_out():
    assert refusal(cookies=[f"intent_page_8080={'B' * 32}; {OURS}"]) == ""


@pytest.mark.parametrize("path", [f"/?{'a=1&' * 20}token={TOKEN}", f"//[?token={TOKEN}#x"])
def test_the_tokens_address_lets_in(path):
    assert refusal(path) == ""


@pytest.mark.parametrize(
    "token", ["\udcff\udcfe", "%ff%fe", "", "A" * 31, "é" * 32, "\x00", f"{TOKEN}&token=x"]
)
def test_a_token_of_raw_bytes_is_refused(token):
    assert refusal(f"/?token={token}")


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1 :8080", " 127.0.0.1:8080", "localhost:8080 x", "localhost;x", "local host", ""]
    + ["localhost:8080:1", "user@localhost:8080", "\udcff", "localhost/", "localhost:٣", "[::1"]
    + ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost@evil.example"],
)
def test_a_host_that_is_none_is_refused(host):
    assert "another name" in refusal(f"/?token={TOKEN}", host)


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8080", "[::1]:8080", "192.168.0.7:80"])
def test_names_and_numbers_of_this_server_are_its_own(host):
    assert refusal(f"/?token={TOKEN}", host) == ""


@pytest.mark.parametrize("upgrade", [False, True])
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_another_page_is_refused(origin, upgrade):
    assert "Another page" in refusal(cookies=[OURS], upgrade=upgrade, origin=[origin])
    sites = {"sec-fetch-site": ["cross-site"]}
    assert bool(refusal(cookies=[OURS], upgrade=upgrade, **sites)) == upgrade
