# SPDX-License-Identifier: Apache-2.0
"""`import intent_recognition as ir`: quick, light, and every name is there and documented."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_imports import HEAVY

import intent_recognition as ir

ROOT = Path(__file__).resolve().parents[1]
MOST_S = 0.5
"""Longest import of the root, with a margin of five: it takes less than a tenth of a second."""
ERRORS = [name for name in ir.__all__ if name.endswith("Error")]
FUNCTIONS = [name for name in ir.__all__ if inspect.isfunction(getattr(ir, name))]
CLASSES = [name for name in ir.__all__ if inspect.isclass(getattr(ir, name)) and name not in ERRORS]


def run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_root_alone_loads_no_room():
    code = "import sys, intent_recognition; print(*[m for m in sys.modules if m[:6] == 'intent'])"
    assert set(run(code).split()) == {"intent_recognition", "intent_recognition.interrupts"}


def test_importing_the_root_is_quick():
    code = "import time; t = time.process_time(); import intent_recognition; "
    assert float(run(code + "print(time.process_time() - t)")) < MOST_S


@pytest.mark.slow
def test_no_name_loads_ros_simulation_plots_or_the_page():
    code = "import sys, intent_recognition as ir; [getattr(ir, n) for n in ir.__all__]; "
    assert run(code + f"print(*[m for m in {HEAVY!r} if m in sys.modules])").split() == []


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = ir.no_such_name


def test_all_is_sorted_and_what_the_stub_takes():
    stub = (ROOT / "intent_recognition" / "__init__.pyi").read_text(encoding="utf-8")
    listed = re.findall(r'^    "(\w+)",$', stub, re.MULTILINE)
    assert sorted(listed) == sorted(ir.__all__) == sorted(set(dir(ir)))


@pytest.mark.parametrize("name", ir.__all__)
def test_every_name_says_what_it_is(name):
    text = inspect.getdoc(getattr(ir, name))
    assert text and len(text.split()) >= 4


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_documents_its_arguments(name):
    function = getattr(ir, name)
    text, parameters = inspect.getdoc(function), inspect.signature(function).parameters
    if len(parameters) > 1:
        assert "Args:" in text
        for parameter in parameters:
            assert re.search(rf"^ +\*{{0,2}}{parameter}(?:, \w+)*:", text, re.MULTILINE), parameter


@pytest.mark.parametrize("name", CLASSES)
def test_every_class_documents_its_attributes(name):
    kind = getattr(ir, name)
    fields = getattr(kind, "__dataclass_fields__", None) or getattr(kind, "_fields", ())
    text = inspect.getdoc(kind)
    for field in fields:
        if not field.startswith("_"):
            assert re.search(rf"\b{field}\b", text), field


@pytest.mark.parametrize("name", ERRORS)
def test_errors_are_one_family(name):
    assert issubclass(getattr(ir, name), ir.IntentError)


def test_values_are_ready_for_numpy():
    assert ir.Gaussian(np.zeros(2), np.eye(2)).mean.shape == (2,)
