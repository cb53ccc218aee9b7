# SPDX-License-Identifier: Apache-2.0
"""What all hostile files have in common: commands under limits, and values that spoil content."""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

EACH = int(os.environ.get("HOSTILE_EACH", "36"))
"""Files of each kind."""
SEED = int(os.environ.get("HOSTILE_SEED", "14"))


class Worker:
    """Runs commands under a limit of memory and time."""

    def __init__(self):
        tests = Path(__file__).parents[1]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "120"}
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment | {"PYTHONPATH": f"{tests.parent}:{tests}"},
            text=True,
        )

    def run(self, *words) -> dict:
        self._process.stdin.write(json.dumps([str(word) for word in words]) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def close(self):
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


def check(worker, *words):
    answer = worker.run(*words)
    text = answer["text"]
    assert answer["code"] in (0, 1, 2), (words, answer)
    assert "Traceback" not in text, (words, text)
    assert "\x1b" not in text, (words, text)
    assert "Warning:" not in text, (words, text)
    if answer["code"] == 1 and words[0] != "inspect":
        assert len(text.strip().splitlines()) >= 1, (words, text)
    return answer


def mutated(rng, data: bytes) -> bytes:
    """Bytes flipped, cut out, repeated or put in."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(len(found) or 1))
        kind = rng.integers(5)
        if kind == 0 and found:
            found[at] = int(rng.integers(256))
        elif kind == 1:
            del found[at : at + int(rng.integers(1, 2000))]
        elif kind == 2:
            found[at:at] = rng.bytes(int(rng.integers(1, 40)))
        elif kind == 3:
            found[at : at + 8] = bytes([255] * 8)
        else:
            found[at:at] = found[at : at + int(rng.integers(1, 5000))]
    return bytes(found)


LINES = [
    "[" * 100_000, "{a: " * 5000, "- " * 50_000, "a: &a {b: *a}", "<<: &a {<<: *a}", "null", "[]",
    "a: 2001-02-31", "a: 2001-13-01 25:61:61", "a: .inf\nb: -.inf\nc: .nan", "a: " + "9" * 100_000,
    "a: " + "1:" * 40_000 + "1", "? [a, b]\n: c", "? {a: b}\n: c", "!!binary x", "!!float a",
    "!!python/object/apply:os.system [true]", "!!timestamp a", "!!int a", "!!set [a]", "a\0b",
    "\x1b[2J: \x07", "a: 'x", "x" * 5_000_000, "a: [" + "b," * 200_000 + "]", "%YAML 9.9\n---\na",
    "---\na: b\n---\nc: d", "\xff\xfe", "",
    "b: &b0 [x, x]\n" + "".join(f"b{k}: &b{k + 1} [*b{k}, *b{k}]\n" for k in range(60)),
]  # fmt: skip
YAMLS = [lambda rng, text=text: text for text in LINES]
VALUES = [
    None, True, -1, 2**63, 1e400, -1e400, float("nan"), "", "x" * 10_000, [], {}, [[]], [None],
    {"a": []}, "2001-02-31", "\x1b[31m", "../../../etc/passwd", "/dev/zero", 10**30, [{}], "{}",
]  # fmt: skip


def spoiled(rng, content, chance=0.15):
    """Plain values, some of them replaced by others."""
    if rng.random() < chance:
        return VALUES[int(rng.integers(len(VALUES)))]
    if isinstance(content, dict):
        return {key: spoiled(rng, value, chance) for key, value in content.items()}
    if isinstance(content, list):
        return [spoiled(rng, value, chance) for value in content]
    return content


CHANGES = (
    lambda rng, a: np.full(a.shape, rng.choice(NUMBERS)),
    lambda rng, a: np.array(["a"] * 3),
    lambda rng, a: a.astype(complex) if a.dtype.kind in "fiu" else a[None],
    lambda rng, a: np.broadcast_to(a, (3, *a.shape)),
    lambda rng, a: a[:0] if a.ndim else np.zeros(0),
    lambda rng, a: a[: len(a) // 40] if a.ndim else a[None],
    lambda rng, a: rng.permutation(a) if a.ndim else np.array(2**63, np.uint64),
    lambda rng, a: a * 1e12 if a.dtype.kind == "f" else np.array("\x1b[2J" * 99),
    lambda rng, a: np.repeat(a[:1], len(a), 0) if a.ndim else np.array(True),
    lambda rng, a: a[:, :2] if a.ndim > 1 else np.where(rng.random(a.shape) < 0.1, np.nan, 1.0),
    lambda rng, a: a.astype(">f8" if a.dtype.kind == "f" else a.dtype),
)
NUMBERS = (np.nan, np.inf, -1.0, 0.0, 1e300, -1e300, 1e9, 1e-300)


def spoiled_arrays(rng, arrays, kept=()):
    """Arrays, whole at first, then one but the `kept` changed or missing each time, without end."""
    names = sorted(arrays.keys() - {*kept})
    yield arrays
    for k in itertools.count():
        name, change = names[k % len(names)], CHANGES[k % len(CHANGES)]
        missing = k >= len(names) and rng.random() < 0.1
        yield {key: a for key, a in arrays.items() if key != name} | (
            {} if missing else {name: change(rng, arrays[name])}
        )


def write_bag(folder: Path, whole, metadata: str | bytes | None = None, content=None) -> Path:
    folder.mkdir()
    (folder / whole[0]).write_bytes(whole[1] if content is None else content)
    text = whole[2] if metadata is None else metadata
    (folder / "metadata.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


def save(path, arrays):
    np.savez(path, **arrays)
    return path
