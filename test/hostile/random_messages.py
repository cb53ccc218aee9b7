# SPDX-License-Identifier: Apache-2.0
"""Messages of any type: their fields hold anything that can be sent, or are good but for some."""

import copy
from array import array
from importlib import import_module

import numpy as np

NUMBERS = (0.0, 1.0, -1.0, 1e-300, 1e300, -1e300, np.inf, -np.inf, np.nan, 3.4e38)
STAMPS = (0, 1, -1, 2**31 - 1, -(2**31), 50, 1_700_000_000)
TEXTS = ("", "a", "b", "none", "\x1b[2J", "<script>", "\u202e", "\0", "x" * 5000, "[" * 5000)


def random_message(rng, kind, texts=TEXTS, depth=0):
    """A message of a type whose fields hold anything that can be sent."""
    message = kind()
    for field, name in kind.get_fields_and_field_types().items():
        if rng.random() < 0.9:
            setattr(message, field, random_value(rng, name, getattr(message, field), texts, depth))
    return message


def random_value(rng, name, default, texts=TEXTS, depth=0):
    """A value of a field, by the name of its type."""
    if name.endswith("]") or name.startswith("sequence"):
        inner = name.removeprefix("sequence<").split(",")[0].rstrip(">").split("[")[0]
        size = len(default) if name.endswith("]") else int(rng.choice([0, 1, 2, 3, 7, 40]))
        if depth > 2:
            size = min(size, 2)
        return [random_value(rng, inner, 0.0, texts, depth + 1) for _ in range(size)]
    if name in ("double", "float"):
        most = 3e38 if name == "float" else np.inf
        value = float(rng.choice(NUMBERS))
        return value if not np.isfinite(value) or abs(value) <= most else most
    if name == "string":
        return str(rng.choice(texts))
    if name == "boolean":
        return bool(rng.integers(2))
    if name in ("octet", "byte"):
        return bytes([int(rng.integers(256))])
    if "int" in name and "/" not in name:
        return int(rng.integers(0, 12))
    package, kind = name.split("/")
    return random_message(rng, getattr(import_module(f"{package}.msg"), kind), texts, depth + 1)


def spoiled_message(rng, message, texts=TEXTS):
    """A copy of a good message with one or two of its fields, at any depth, replaced."""
    message = copy.deepcopy(message)
    for _ in range(int(rng.integers(1, 3))):
        _spoil(rng, message, texts)
    return message


def _spoil(rng, message, texts):
    fields = message.get_fields_and_field_types()
    field = str(rng.choice(list(fields)))
    name, value = fields[field], getattr(message, field)
    if hasattr(value, "get_fields_and_field_types"):
        _spoil(rng, value, texts)
    elif name == "int32" and field == "sec":
        setattr(message, field, int(rng.choice(STAMPS)))
    elif "int" in name and "[" not in name and "<" not in name:
        most = 2 ** (int(name.strip("uint")) - (name[0] != "u")) - 1
        setattr(message, field, int(rng.choice([0, 1, 3, most // 2, most])))
    elif isinstance(value, array | list | np.ndarray) and len(value) and "[" not in name:
        setattr(message, field, _changed(rng, value, texts))
    else:
        setattr(message, field, random_value(rng, name, value, texts))


def _changed(rng, values, texts):
    """A list with an element replaced, fewer, doubled, or very many."""
    values, at = list(values), int(rng.integers(len(values)))
    kind = rng.integers(4)
    if kind == 0:
        return values[:at]
    if kind == 1:
        return values * 2
    if kind == 2 and len(values) < 100:
        return values * 500
    if isinstance(values[at], float):
        values[at] = float(rng.choice(NUMBERS))
    elif isinstance(values[at], str):
        values[at] = str(rng.choice(texts))
    elif isinstance(values[at], int):
        values[at] = int(rng.integers(128))
    elif hasattr(values[at], "get_fields_and_field_types"):
        values[at] = copy.deepcopy(values[at])
        _spoil(rng, values[at], texts)
    return values
