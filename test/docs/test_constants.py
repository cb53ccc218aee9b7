# SPDX-License-Identifier: Apache-2.0
"""Every number at the top of a file says what it is, in which unit and why."""

import re
import sys

from docs.shown import ROOT

sys.path.append(str(ROOT / "docs" / "tools"))
from constants_page import constants

UNIT = re.compile(r"(?<!_PER)_(?:S|M|MM|CM|RAD|HZ|N|KG|NS|M_S|RAD_S|RAD_M|PIXELS)$")


def undocumented(documented):
    files = (p for top in ("intent_recognition", "sim_bridge") for p in (ROOT / top).rglob("*.py"))
    return [
        f"{path.relative_to(ROOT)}: {constant.name}"
        for path in sorted(files)
        for constant in constants(path)
        if not documented(constant)
    ]


def test_every_constant_has_a_docstring():
    assert undocumented(lambda constant: constant.text) == []


def test_a_constant_whose_name_has_a_unit_names_it():
    def names_it(constant):
        return not UNIT.search(constant.name) or "[" in constant.text

    assert undocumented(names_it) == []
