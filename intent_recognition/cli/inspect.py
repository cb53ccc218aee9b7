# SPDX-License-Identifier: Apache-2.0
"""Show the content of a bag (topics, rates, gaps, outliers, labels), of each bag of a folder, or
of a model (tasks, degrees of freedom, timing, noise, provenance); of a library, each task's results
since each change. The exit code is 1 if a bag is damaged.

paths BAG|MODEL|TASKS...  a bag, a folder of bags, a model, or a library of tasks; any number
--dofs F                  DOF file whose streams are checked (default: all tracked bodies and
                          joint_states)
--json OUT                what is in it

# one line per recording
intent inspect bags/toolbox/test
# one recording: topics, rates, gaps, outliers
intent inspect demos/give_bracket_00
# a library of tasks: what changed, and how executions went
intent inspect tasks
# a model, for a script
intent inspect bracket.npz --json
"""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import track

from intent_recognition.bags import cure_of
from intent_recognition.cli import output
from intent_recognition.cli.console import plain_table, print_facts
from intent_recognition.cli.inspect_bag import bag_json, print_bag, print_folder
from intent_recognition.cli.inspect_model import model_json, print_model
from intent_recognition.cli.rejections import print_doubtful
from intent_recognition.demonstrations import (
    BagSummary,
    DofSpec,
    find_bags,
    inspect_bag,
    inspect_streams,
    load_dofs,
    settle_orientations,
)
from intent_recognition.errors import BagError
from intent_recognition.model import (
    Executions,
    SkillPeriod,
    is_task_folder,
    load_model,
    now,
    read_history,
    skill_history,
)
from intent_recognition.signals import Rejection, StreamFinding, label_doubts, stream_doubts

CURE = "Give a bag, a folder of bags, or a model that `intent train` wrote."


def run(args: argparse.Namespace) -> int:
    """Print all paths: models first, then the recordings, several of them in one table."""
    output.check_outputs(args)
    console = output.table_console(args)
    models = [path for path in args.paths if path.suffix == ".npz"]
    sources = [path for path in args.paths if path not in models]
    if any(path.is_absolute() for path in sources):
        sources = [path.absolute() for path in sources]
    folders = [path for path in sources if is_task_folder(path)]
    sources = [path for path in sources if path not in folders]
    loaded = [load_model(path) for path in models]
    bags = [bag for source in sources for bag in _bags_of(source)]
    dofs = None if args.dofs is None else settle_orientations(load_dofs(args.dofs), bags)
    content: list[object] = [model_json(model) for model in loaded]
    for path, model in zip(models, loaded, strict=True):
        print_model(console, path, model)
    for path in folders:
        skills = skill_history(read_history(path), Executions(path, now).all())
        tasks = {label: [one._asdict() for one in periods] for label, periods in skills.items()}
        content.append({"path": str(path), "tasks": tasks})
        _print_tasks(console, path, skills)
    failed, is_one = False, len(bags) == 1 and bags == sources
    if bags:
        root = Path(os.path.commonpath(sources))
        root = root.parent if root in bags else root
        listed, failed = _inspect_bags(console, root, bags, dofs, is_one)
        content += listed
    alone = len(args.paths) == 1 and (models or folders or is_one)
    output.write_json(args.json, content[0] if alone else content)
    return int(failed)


def _bags_of(source: Path) -> list[Path]:
    if not source.exists():
        expected = "a bag, a folder of bags, a model (.npz) or a library of tasks"
        raise BagError.about(str(source), expected, "nothing", "Check the path.")
    bags = find_bags(source)
    if not bags:
        cure = cure_of(source, CURE)
        raise BagError.about(str(source), "recordings", "none in this folder", cure)
    return bags


def _inspect_bags(
    console: Console, root: Path, bags: Sequence[Path], dofs: DofSpec | None, is_one: bool
) -> tuple[list[object], bool]:
    """Print one readable bag in full, or a line per bag; return JSON and whether any is damaged."""
    found: list[tuple[Path, BagSummary | BagError]] = []
    stderr = Console(stderr=True)
    for bag in track(
        bags, "reading", console=stderr, transient=True, disable=not stderr.is_terminal
    ):
        try:
            found.append((bag, inspect_bag(bag)))
        except BagError as error:
            if is_one:
                raise
            found.append((bag, error))
    faults = _stream_faults(found, root, dofs)
    if is_one and isinstance(summary := found[0][1], BagSummary):
        print_bag(console, summary)
    else:
        print_folder(console, root, found)
    print_doubtful(console, [fault for faulty in faults.values() for fault in faulty])
    listed: list[object] = [
        bag_json(got) | {"streams": [f.reason for f in faults[bag]]}
        if isinstance(got, BagSummary)
        else {"path": str(bag), "error": str(got)}
        for bag, got in found
    ]
    return listed, any(isinstance(got, BagError) or got.damage for _, got in found)


def _stream_faults(
    bags: Sequence[tuple[Path, BagSummary | BagError]], root: Path, dofs: DofSpec | None
) -> dict[Path, list[StreamFinding]]:
    """Possible faults between the streams of each bag that can be read."""
    faults: dict[Path, list[StreamFinding]] = {path: [] for path, _ in bags}
    summaries, owners = [], []
    for path, summary in bags:
        if isinstance(summary, BagError) or summary.damage or summary.unfinished:
            continue
        name = str(path.relative_to(root))
        for index, found in enumerate(inspect_streams(path, dofs)):
            part = f"{name}#{index:03d}" if summary.demonstrations else name
            if isinstance(found, Rejection):
                faults[path].append(StreamFinding(part, found.reason))
            else:
                summaries.append(found._replace(name=part))
                owners.append(path)
    owner = {one.name: path for one, path in zip(summaries, owners, strict=True)}
    labels = label_doubts((one.name, one.task) for one in summaries)
    for doubt in [*stream_doubts(summaries), *labels]:
        faults[owner[doubt.name]].append(doubt)
    return faults


def _print_tasks(console: Console, path: Path, skills: dict[str, list[SkillPeriod]]) -> None:
    """Print one row per change of each task, with the outcomes of the executions since then."""
    n = sum(one.n_executions for periods in skills.values() for one in periods)
    print_facts(console, {"tasks": str(path), "executions": str(n)})
    numbers = ">shown", ">done", ">arrived", ">corrected", ">good", ">bad", ">spilled"
    spilled = any(one.spilled is not None for periods in skills.values() for one in periods)
    table = plain_table("task, since", "change", *numbers[: None if spilled else -1])
    for label, periods in skills.items():
        table.add_row(label)
        for one in periods:
            demonstrations = str(one.n_demonstrations) if one.since else "-"
            texts = one.texts()[: None if spilled else -1]
            table.add_row(f"  {one.since[:16]}".replace("T", " "), one.what, demonstrations, *texts)
    console.print(table)
