# SPDX-License-Identifier: Apache-2.0
"""The figures that README and docs show: measured by commands, kept in docs/figures.json.

`python docs/tools/figures.py NAME ...` runs the commands of these figures, keeps what they
measured, and writes it into the pages. Without a name it runs those that are missing or of another
command or code; each is kept when it is done, so that an interrupted run goes on where it was.
`--list` shows which, and how long they take; `--write` writes the pages. Measure on a machine with
nothing else to do.

A page shows a table or a printed text between `<!-- figures NAME -->` and `<!-- end -->`, and a
single value before `<!--NAME.KEY-->`. What is old or missing is marked on the page.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from hashlib import blake2b
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from intent_recognition import __version__

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docs" / "figures.json"
OUT = Path("out/figures")
MEASURED = ("intent_recognition", "sim_bridge", "experiments", "benchmarks", "config")
"""Folders whose code and settings figures depend on."""
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
BLOCK = re.compile(r"(?<=<!-- figures )(\S+) -->\n.*?(?=<!-- end -->)", re.DOTALL)
INLINE = re.compile(r"[^\s|(]+(?=<!--([\w./]+)\.(\w+)-->)")
MISSING = "?"
"""Stands for a single value that was not measured yet."""
EXPERIMENTS = {
    **dict.fromkeys(("pointing", "pole", "toolbox"), " --seeds 10"),
    **dict.fromkeys(("sparse", "noise", "alignment", "assembly", "feedback", "context"), ""),
    **dict.fromkeys(("change_of_mind", "clearance", "skills", "constraints", "grasps"), ""),
    "pouring": "",
}
"""The papers' experiments, each with its options."""


MINUTES = {
    **{f"experiments/{name}": 5.0 for name in EXPERIMENTS},
    **dict.fromkeys(("experiments/pointing", "experiments/pole", "experiments/toolbox"), 25.0),
    **dict.fromkeys(("experiments/skills", "experiments/constraints"), 20.0),
    **dict.fromkeys(("experiments/clearance", "experiments/pouring", "practice"), 10.0),
    **{"speed": 40.0, "arms": 24.0, "demo": 6.0, "transfer": 10.0},
}
"""Run times on two quiet cores [min], guessed; those that were measured once stand in the file."""


ACCURACY = (
    "warping", "point mapping, ", "pouring", "filling", "balls", "transfers", "robot gives",
    "bumps", "wet objects", "released", "unknown", "accuracy", "each task left out", "purity",
    "... labels", "... their number", "aligning, ", "poses solved", "... growth, ", "... messages",
    "... off", "soak: memory", "soak: file", "soak: threads", "soak: nodes",
)  # fmt: skip
"""Parts of the names of benchmarks that measure no speed."""


class Source(NamedTuple):
    """Commands, the JSON file that the last one writes (None: its output), and what to keep."""

    command: str
    result: Path | None
    keep: Callable[[Any], dict]


def _findings(name: str) -> Callable[[Any], dict]:
    """Rows of an experiment: what, the paper's figure, ours."""

    def keep(numbers: Any) -> dict:
        found = numbers["experiments"][name]["findings"]
        rows = [[f["quantity"], f["paper"] or "-", f["ours"]] for f in found]
        return {"rows": [["", "paper or required", "ours"], *rows]}

    return keep


def _benchmarks(results: Any) -> dict:
    rows = []
    for one in results:
        values = [f"{one[key]:.3g} {one['unit']}".strip() for key in ("required", "measured")]
        short = one["verdict"] != "ok"
        shown = f"**{values[1]}, falls short**" if short else values[1]
        rows.append([one["name"], f"{one['direction']} {values[0]}", shown])
    return {"rows": [["what", "required", "measured"], *rows]}


def _speeds(results: Any) -> dict:
    """Benchmarks that require something, without those of accuracy, which other pages show."""
    some = [one for one in results if not any(part in one["name"] for part in ACCURACY)]
    return _benchmarks([one for one in some if isfinite(one["required"])])


def _printed(text: Any) -> dict:
    """The output of a command without its lines of progress."""
    kept = [line for line in text.strip().splitlines() if not line.endswith((" s", " s more"))]
    return {"text": "\n".join(kept).replace(f"{OUT}/", "")}


def _last_line(text: Any) -> dict:
    return {"text": text.strip().splitlines()[-1]}


def _first_table(text: Any) -> dict:
    """What a command printed up to the end of its first table."""
    return {"text": text[: text.index("┘") + 1].rstrip()}


def _table(text: Any) -> dict:
    """The last table that a command printed, and what follows it."""
    lines = text.rstrip().splitlines()
    top = max(k for k, line in enumerate(lines) if line.startswith("┏"))
    return {"text": "\n".join(lines[top - 1 :])}


def _demo(numbers: Any) -> dict:
    line = textwrap.fill(numbers["summary"]["line"], 100, subsequent_indent="  ")
    return {"text": line, "values": {"recognised": line.split()[2].rstrip(",")}}


MODEL = OUT / "toolbox.npz"
LEARN = f"intent train bags/toolbox/train --output {MODEL}"


def _arms(numbers: Any) -> dict:
    """A row for each arm."""
    head = ["arm", "recognised", "decided at (median)", "hand error [cm]", "its median", "largest"]
    rows = [[*head, "arrival after the worker (median)"]]
    for arm, one in numbers["arms"].items():
        found, error = one["summary"], one["summary"]["hand_error"]
        cm = [100 * i["hand_error_m"] for i in one["interactions"] if i["hand_error_m"] is not None]
        rows.append(
            [
                arm,
                f"{found['recognised_right']}/{found['n']}",
                f"{100 * found['median_decision_share']:.0f} %",
                f"{error['mean_cm']:.1f} +- {error['two_std_cm']:.1f}",
                f"{median(cm):.1f}",
                f"{max(cm):.1f}",
                f"{found['median_arrival_s']:+.2f} s",
            ]
        )
    return {"rows": rows}


TAKES = "python docs/tutorials/example_takes.py"
SOURCES = {
    "own_takes": Source(
        f"{TAKES} {OUT / 'takes'} && {TAKES} {OUT / 'new_takes'} --number 1 --seed 2"
        f" && intent import {OUT / 'takes'} --suggest --output {OUT / 'map.yaml'}"
        f" && intent import {OUT / 'takes'} --map {OUT / 'map.yaml'} --output {OUT / 'demos'}"
        f" && intent import {OUT / 'new_takes'} --map {OUT / 'map.yaml'}"
        f" --output {OUT / 'held_out'} && intent train {OUT / 'demos'}"
        f" --dofs {OUT / 'demos/dofs.yaml'} --output {OUT / 'mine.npz'}"
        f" && intent demo --arm panda --headless --model {OUT / 'mine.npz'}"
        f" --recordings {OUT / 'held_out'} --output {OUT / 'demo_takes'}",
        None,
        _table,
    ),
    **{
        f"experiments/{name}": Source(
            f"intent experiments {name}{more} --output {OUT / name}",
            OUT / name / "numbers.json",
            _findings(name),
        )
        for name, more in EXPERIMENTS.items()
    },
    "transfer": Source(
        f"python -m benchmarks.transfer --json {OUT / 'transfer.json'}",
        OUT / "transfer.json",
        _benchmarks,
    ),
    "speed": Source(
        f"python -m benchmarks --json {OUT / 'speed.json'}", OUT / "speed.json", _speeds
    ),
    **{
        name: Source(
            f"{LEARN} && intent replay bags/toolbox/test/{bag} --model {MODEL}", None, _last_line
        )
        for name, bag in (("replay", "plate_handover_00"), ("replay_task", "hold_screwdriver_00"))
    },
    **{
        name: Source(f"{LEARN} && intent {name} {given}", None, _first_table)
        for name, given in (
            ("explain", f"bags/toolbox/test/plate_handover_00 --model {MODEL}"),
            ("rehearse", f"{MODEL} bags/toolbox/test"),
        )
    },
    "practice": Source(
        f"intent improve pouring --short 0.9 --output {OUT / 'practice'}", None, _printed
    ),
    "practice_task": Source(
        f"{LEARN} && intent improve screw_handover --library {OUT / 'tasks'} --model {MODEL}"
        " --cost time",
        None,
        _printed,
    ),
    "demo_short": Source(
        f"intent demo --headless --interactions 5 --seed 2 --output {OUT / 'demo_short'}"
        f" --json {OUT / 'demo_short.json'}",
        OUT / "demo_short.json",
        _demo,
    ),
    "arms": Source(
        "intent demo --headless --no-transfers --arm lwr,panda,iiwa,xarm --seed 1"
        f" --output {OUT / 'arms'} --json {OUT / 'arms.json'}",
        OUT / "arms.json",
        _arms,
    ),
    "compose": Source(
        "intent demo --headless --sequences config/examples/toolbox_sequence.yaml --task-list"
        " plate_handover,screw_handover,plate_handover,screw_handover"
        f" --output {OUT / 'compose'} --json {OUT / 'compose.json'}",
        OUT / "compose.json",
        _demo,
    ),
    "demo": Source(
        f"intent demo --headless --seed 1 --output {OUT / 'demo'} --json {OUT / 'demo.json'}",
        OUT / "demo.json",
        _demo,
    ),
}


def load() -> dict[str, dict]:
    """What was measured, by name: command, version, and rows, text or values."""
    return json.loads(FILE.read_text(encoding="utf-8"))


@cache
def code() -> str:
    """Digest of what figures depend on: they are measured again where it has changed."""
    digest = blake2b(digest_size=6)
    for folder in MEASURED:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".c", ".yaml"):
                digest.update(path.read_bytes())
    return digest.hexdigest()


def is_current(name: str, figures: Mapping[str, Mapping]) -> bool:
    """Whether a figure was measured by its command of today, with this code."""
    figure = figures.get(name, {})
    said = (figure.get("version"), figure.get("command"), figure.get("code"))
    return said == (__version__, SOURCES[name].command, code())


def minutes(name: str, figures: Mapping[str, Mapping]) -> float:
    """How long a figure takes [min]: as the last time, or as guessed."""
    return figures.get(name, {}).get("seconds", 60.0 * MINUTES.get(name, 2.0)) / 60.0


def plan(names: Sequence[str]) -> str:
    """Figures with their state and time, a line each, and the time of those that are to be run."""
    figures = load()
    lines = []
    for name in SOURCES:
        figure = figures.get(name, {})
        version = figure.get("version", "not measured")
        other = "other code" if version == __version__ else version
        state = "current" if is_current(name, figures) else other
        known = "" if "seconds" in figure else " (guessed)"
        mark = "*" if name in names else " "
        lines.append(f"{mark} {name:28}{state:14}{minutes(name, figures):5.0f} min{known}")
    total = sum(minutes(name, figures) for name in names)
    return "\n".join([*lines, f"* to measure: {len(names)}, about {total:.0f} min"])


def measured(name: str) -> dict:
    """Run the command of a figure, and return what is kept of its result."""
    source, printed, start_s = SOURCES[name], "", time.monotonic()
    (ROOT / OUT).mkdir(parents=True, exist_ok=True)
    if source.result is not None:  # what an earlier run left is no result of this one
        (ROOT / source.result).unlink(missing_ok=True)
    programs = Path(sys.executable).parent
    for command in source.command.split(" && "):
        words = shlex.split(command)
        words[0] = sys.executable if words[0] == "python" else str(programs / words[0])
        kept = subprocess.PIPE if source.result is None else None
        done = subprocess.run(words, cwd=ROOT, check=False, stdout=kept, text=True)
        printed = done.stdout  # the exit code is 1 where a figure is missed
    found = printed
    if source.result is not None:
        found = json.loads((ROOT / source.result).read_text(encoding="utf-8"))
    said = {"version": __version__, "code": code(), "seconds": round(time.monotonic() - start_s)}
    return {"command": source.command, **said, **source.keep(found)}


def with_figures(page: str, figures: Mapping[str, Mapping]) -> str:
    """The text of a page with the figures in their places."""

    def block(match: re.Match) -> str:
        return f"{match[1]} -->\n{_shown(match[1], figures.get(match[1], {}))}\n"

    def value(match: re.Match) -> str:
        return str(figures.get(match[1], {}).get("values", {}).get(match[2], MISSING))

    return INLINE.sub(value, BLOCK.sub(block, page))


def _shown(name: str, figure: Mapping) -> str:
    """A figure in Markdown, with a note where it is missing or of another version."""
    if not figure:
        return f'*Not measured yet: `make figures FIGURES="{name}"`.*'
    is_old = figure.get("version", __version__) != __version__
    note = f"\n\n*Measured with version {figure['version']}.*" if is_old else ""
    return _content(figure) + note


def _content(figure: Mapping) -> str:
    if "text" in figure:
        return f"```text\n{figure['text']}\n```"
    head, *rows = figure["rows"]
    lines = ["|" + "|".join(row) + "|" for row in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def main() -> None:
    """Measure, keep, and write the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SOURCES))
    parser.add_argument("--list", action="store_true", help="only show what would be measured")
    parser.add_argument("--write", action="store_true", help="only write the pages")
    args = parser.parse_args()
    figures = load()
    names = args.names or [name for name in SOURCES if not is_current(name, figures)]
    if args.list or not args.write:
        print(plan(names), flush=True)
    if args.list:
        return
    failed = []
    for name in () if args.write else names:
        print(f"measuring {name}", flush=True)
        try:
            found = measured(name)
        except (OSError, ValueError, LookupError) as error:  # the others are still measured
            failed.append(f"{name} ({error})")
            continue
        figures = {**load(), name: found}  # another run may have written meanwhile
        text = json.dumps(dict(sorted(figures.items())), indent=1, ensure_ascii=False)
        FILE.write_text(text + "\n", encoding="utf-8")
    figures = load()
    for path in PAGES:
        page = path.read_text(encoding="utf-8")
        path.write_text(with_figures(page, figures), encoding="utf-8")
    if failed:
        sys.exit(f"not measured, what was there stays: {', '.join(failed)}")


if __name__ == "__main__":
    main()
