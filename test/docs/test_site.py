# SPDX-License-Identifier: Apache-2.0
"""The site builds without a warning, and reading it asks nothing of the network."""

import os
import re
import sys
from importlib.util import find_spec

import pytest
from docs.shown import PAGES, ROOT
from matplotlib import rc_context
from programs import output_of

import intent_recognition as ir

pytestmark = [pytest.mark.slow, pytest.mark.long]

LOADED = re.compile(
    r"<(?:script|img|iframe|source)[^>]+src=\"([^\"]+)\"|<link[^>]+href=\"([^\"]+)\""
)
STYLE = re.compile(r"url\([\"']?(?!data:)([^)\"']+)|@import[^;]+")


@pytest.fixture(scope="module")
def site(once):
    if not all(map(find_spec, ("sphinx", "myst_parser", "furo", "sphinx_gallery"))):
        if os.environ.get("CI"):
            pytest.fail("no Sphinx: pip install -r requirements-docs.txt")
        pytest.skip("no Sphinx (requirements-docs.txt)")
    return once("site", build) / "html"


def build(folder):
    """All pages without the theme, which takes half of the time, and one with it.

    test_examples.py runs the examples.
    """
    options = ["-q", "-c", "docs", "-b", "html", "-d", f"{folder}/trees", "-D", "plot_gallery=0"]
    plain = ["-W", "--keep-going", "-D", "html_theme=basic"]
    output_of(sys.executable, "-m", "sphinx", *options, *plain, ".", f"{folder}/html")
    themed = [".", f"{folder}/html/themed", "README.md"]
    output_of(sys.executable, "-m", "sphinx", *options, *themed)


def test_every_page_is_there(site):
    for page in PAGES:
        assert (site / page.relative_to(ROOT)).with_suffix(".html").is_file()
    entrance = (site / "index.html").read_text(encoding="utf-8")
    assert (site / re.search(r"url=([^\"]+)", entrance)[1]).is_file()


def test_the_reference_has_a_page_of_every_public_name(site):
    index = (ROOT / "docs" / "api" / "index.rst").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^   (\w+)$", index, re.MULTILINE)) == sorted(ir.__all__)
    for name in ir.__all__:
        page = site / "docs" / "api" / "generated" / f"intent_recognition.{name}.html"
        assert f'id="intent_recognition.{name}"' in page.read_text(encoding="utf-8")


def test_the_reference_says_what_a_function_returns_and_no_sentence_of_it_is_cut(site):
    api = site / "docs" / "api"
    learn = (api / "generated" / "intent_recognition.learn.html").read_text(encoding="utf-8")
    assert "TaskLibrary" in learn.partition("Return type")[2].partition("</dd>")[0]
    shown = (api / "index.html").read_text(encoding="utf-8")
    assert "Condition on y = H w + noise." in shown and "Eq.</p>" not in shown


def test_nothing_is_fetched(site):
    for page in site.rglob("*.html"):
        for found in LOADED.findall(page.read_text(encoding="utf-8")):
            target = found[0] or found[1]
            assert not target.startswith(("http", "//")), (page, target)
    for sheet in site.rglob("*.css"):
        for target in STYLE.findall(sheet.read_text(encoding="utf-8")):
            assert not target.startswith(("http", "//")), (sheet, target)


def test_formulae_are_drawn(site):
    for page in PAGES:
        source = page.read_text(encoding="utf-8")
        text = (site / page.relative_to(ROOT)).with_suffix(".html").read_text(encoding="utf-8")
        assert text.count('<svg class="formula"') == source.count("```math"), page
        assert "$$" not in text, page


def test_a_formula_is_drawn_whatever_the_style_of_the_gallery(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "tools"))
    formulae = pytest.importorskip("formulae")
    drawn = formulae.drawing.__wrapped__(r"\dfrac{1}{2}")
    with rc_context({"text.parse_math": False}):
        assert formulae.drawing.__wrapped__(r"\dfrac{1}{2}") == drawn
