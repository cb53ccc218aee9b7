# SPDX-License-Identifier: Apache-2.0
"""Bags and models as tables in a terminal."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from intent_recognition.bags import Damage
from intent_recognition.demonstrations import BagSummary, TopicSummary
from intent_recognition.errors import BagError
from intent_recognition.model import Model
from intent_recognition.promp import AlignedPrimitives, least_end_std

FIRST_PLAUSIBLE_NS = 1_000_000_000 * 86_400 * 365
GAPS_SHOWN = 5
BAGS_SHOWN = 5


def print_bag(console: Console, summary: BagSummary) -> None:
    """Everything about one bag."""
    _facts(
        console,
        {
            "bag": summary.path,
            "task": summary.task or "(no label)",
            **{key: text for key, text in summary.custom_data.items() if key != "task"},
            "recorded": f"{moment(summary.start_ns)}, {summary.duration_s:.2f} s",
            "messages": str(summary.message_count),
        },
    )
    table = _table("topic", "type", ">messages", ">rate [Hz]", ">gaps", ">longest [s]", "problems")
    for topic in summary.topics:
        table.add_row(
            escape(topic.name),
            escape(topic.type),
            str(topic.count),
            f"{topic.rate_hz:.1f}" if topic.rate_hz else "-",
            str(len(topic.gaps)),
            f"{topic.longest_gap_s:.3f}" if topic.count > 1 else "-",
            escape(problems(topic)) or "-",
        )
    console.print(table)
    for topic in summary.topics:
        _print_gaps(console, topic, summary.start_ns)
    _print_session(console, summary)
    for damage in summary.damage:
        console.print(escape(damage_line(damage)), style="red", highlight=False)
    for note in summary.notes:
        console.print(f"note: {escape(note)}", style="yellow", highlight=False)


def print_folder(
    console: Console, root: Path, found: Sequence[tuple[Path, BagSummary | BagError]]
) -> None:
    """One line per bag below `root`, then how many of each task."""
    table = _table("bag", "task", ">length [s]", ">messages", ">topics", ">gaps", "problems")
    tasks: Counter[str] = Counter()
    for path, got in found:
        name = escape(str(path.relative_to(root)))
        if isinstance(got, BagError):
            table.add_row(name, *"-----", f"[red]{escape(str(got))}[/red]")
            continue
        tasks.update([part.task for part in got.demonstrations] or [got.task or "(no label)"])
        label = f"session of {len(got.demonstrations)}" if got.demonstrations else got.task
        issues = [problems(topic) for topic in got.topics]
        issues += [f"{len(got.damage)} damaged"] if got.damage else []
        table.add_row(
            name,
            escape(label or "(no label)"),
            f"{got.duration_s:.2f}",
            str(got.message_count),
            str(len(got.topics)),
            str(sum(len(topic.gaps) for topic in got.topics)),
            escape(", ".join(filter(None, issues))) or "-",
        )
    console.print(table)
    counts = ", ".join(f"{task} {count}" for task, count in sorted(tasks.items()))
    console.print(f"{len(found)} bags: {escape(counts)}", highlight=False)


def _prediction(primitives: AlignedPrimitives | None) -> str:
    """What trajectories are predicted from."""
    if primitives is None:
        return "at steady progress"
    deviation_std = primitives.phase_deviation.deviation_std.max()
    return (
        f"aligned, {primitives.basis.n_basis} functions, noise scale {primitives.noise_scale:.3g},"
        f" phase deviations up to {100 * deviation_std:.2g} % of the movement (std)"
    )


def print_model(console: Console, path: Path, model: Model) -> None:
    """What was learned, with what accuracy, and from what."""
    library = model.library
    origin = dict(library.provenance)
    bags = [str(bag) for bag in _listed(origin.pop("bags", ()))]
    _facts(
        console,
        {
            "model": str(path),
            "basis": f"{library.basis.n_basis} functions per degree of freedom",
            "none": f"prior {library.none_prior:.3g}",
            "noise": f"scale {library.noise_scale:.3g}, correlated over"
            f" {library.correlation_time_s:.3g} s; in recognition, scale"
            f" {library.recognition_noise_scale:.3g}",
            "prediction": _prediction(library.aligned),
            **{key: _brief(value) for key, value in origin.items()},
        },
    )
    tasks = _table(
        "task",
        ">demonstrations",
        ">median [s]",
        ">2.5 % to 97.5 % [s]",
        ">prior",
        ">end std, least",
    )
    low, high = (
        np.exp(library.log_duration_mean + factor * library.log_duration_std) for factor in (-2, 2)
    )
    for k, label in enumerate(library.labels):
        tasks.add_row(
            escape(label),
            str(int(library.n_demonstrations[k])),
            f"{library.durations_s[k]:.2f}",
            f"{low[k]:.2f} to {high[k]:.2f}",
            f"{library.task_prior[k]:.3f}",
            f"{least_end_std(library.primitives, k):.3f}",
        )
    console.print(tasks)
    dofs = _table("agent", "degree of freedom", "unit", ">noise std")
    rows = (
        *(("observed", n, u) for n, u in zip(library.observed_names, library.observed_units)),
        *(("controlled", n, u) for n, u in zip(library.controlled_names, library.controlled_units)),
    )
    for (agent, name, unit), variance in zip(rows, library.noise_variance, strict=True):
        dofs.add_row(agent, escape(name), escape(unit), f"{np.sqrt(variance):.4f}")
    console.print(dofs)
    if bags:
        more = f", and {len(bags) - BAGS_SHOWN} more" if len(bags) > BAGS_SHOWN else ""
        shown = ", ".join(bags[:BAGS_SHOWN])
        console.print(f"from {len(bags)} bags: {escape(shown)}{more}", highlight=False)


def problems(topic: TopicSummary) -> str:
    """What a node would drop, what is not finite, what cannot be decoded."""
    parts = [f"{count} {reason}" for reason, count in sorted(topic.rejected.items()) if count]
    if topic.not_finite and not topic.rejected.get("not_finite"):
        parts.append(f"{topic.not_finite} not finite")
    if topic.undecodable:
        parts.append(f"{topic.undecodable} undecodable")
    return ", ".join(parts)


def damage_line(damage: Damage) -> str:
    """One stretch of a file that cannot be read."""
    when = f", {moment(damage.start_ns)}" if damage.start_ns else ""
    return f"damaged at byte {damage.offset}{when}: {damage.reason}"


def moment(stamp_ns: int) -> str:
    """A date in UTC; plain seconds for clocks that do not count from 1970."""
    if stamp_ns < FIRST_PLAUSIBLE_NS:
        return f"t = {stamp_ns * 1e-9:.3f} s"
    when = datetime.fromtimestamp(stamp_ns * 1e-9, tz=timezone.utc)
    return when.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] + " UTC"


def _print_gaps(console: Console, topic: TopicSummary, start_ns: int) -> None:
    if not topic.gaps:
        return
    shown = ", ".join(
        f"{length:.3f} s at {(stamp_ns - start_ns) * 1e-9:.2f} s"
        for stamp_ns, length in topic.gaps[:GAPS_SHOWN]
    )
    more = f", and {len(topic.gaps) - GAPS_SHOWN} more" if len(topic.gaps) > GAPS_SHOWN else ""
    console.print(f"gaps in {escape(topic.name)}: {shown}{more}", style="yellow", highlight=False)


def _print_session(console: Console, summary: BagSummary) -> None:
    if summary.demonstrations:
        table = _table(">#", "task", ">start [s]", ">length [s]")
        for part in summary.demonstrations:
            table.add_row(
                str(part.index),
                escape(part.task),
                f"{(part.start_ns - summary.start_ns) * 1e-9:.2f}",
                f"{(part.end_ns - part.start_ns) * 1e-9:.2f}",
            )
        console.print(table)
    for rejection in summary.unfinished:
        console.print(f"unfinished: {escape(rejection.reason)}", style="yellow", highlight=False)


def _facts(console: Console, facts: Mapping[str, str]) -> None:
    width = max(map(len, facts))
    for name, value in facts.items():
        line = f"[bold]{escape(name.ljust(width))}[/bold]  {escape(str(value))}"
        console.print(line, highlight=False, soft_wrap=True)


def _table(*titles: str) -> Table:
    """A table whose titles beginning with `>` head columns of numbers."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for title in titles:
        number = title.startswith(">")
        table.add_column(
            escape(title.removeprefix(">")), justify="right" if number else "left", overflow="fold"
        )
    return table


def _listed(value: object) -> Iterable:
    return value if isinstance(value, (list, tuple)) else [value]


def _brief(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_brief(item)}" for key, item in value.items())
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(_brief(item) for item in value) + ")"
    return str(value)
