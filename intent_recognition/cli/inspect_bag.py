# SPDX-License-Identifier: Apache-2.0
"""Recordings in `intent inspect`: as tables, and as plain values for JSON."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path

from rich.console import Console

from intent_recognition.bags import RECOVER, Damage
from intent_recognition.cli.console import plain_table, print_facts
from intent_recognition.demonstrations import BagSummary, TopicSummary
from intent_recognition.errors import BagError, first_of


def bag_json(summary: BagSummary) -> dict:
    """A bag's summary as plain values."""
    return asdict(summary) | {
        "duration_s": summary.duration_s,
        "message_count": summary.message_count,
    }


def print_bag(console: Console, summary: BagSummary) -> None:
    """Print everything known about one bag."""
    facts = {
        "bag": summary.path,
        "task": summary.task or "(no label)",
        **{key: text for key, text in summary.custom_data.items() if key != "task"},
        "recorded": f"{moment(summary.start_ns)}, {summary.duration_s:.2f} s",
        "messages": str(summary.message_count),
    }
    print_facts(console, facts)
    numbers = (">messages", ">rate [Hz]", ">gaps", ">longest [s]")
    table = plain_table("topic, type", *numbers, "problems")
    for topic in summary.topics:
        table.add_row(
            f"{topic.name}\n{topic.type}",
            str(topic.count),
            f"{topic.rate_hz:.1f}" if topic.rate_hz else "-",
            str(len(topic.gaps)),
            f"{topic.longest_gap_s:.3f}" if topic.count > 1 else "-",
            problems(topic) or "-",
        )
    console.print(table)
    for topic in summary.topics:
        if topic.gaps:
            gaps = [
                f"{length:.3f} s at {(at_ns - summary.start_ns) * 1e-9:.2f} s"
                for at_ns, length in topic.gaps
            ]
            console.print(f"gaps in {topic.name}: {first_of(gaps)}", style="yellow")
    _print_session(console, summary)
    for damage in summary.damage:
        console.print(damage_line(damage), style="red")
    if summary.damage:
        console.print(RECOVER, style="red")
    for note in summary.notes:
        console.print(f"note: {note}", style="yellow")


def print_folder(
    console: Console, root: Path, found: Sequence[tuple[Path, BagSummary | BagError]]
) -> None:
    """Print one line per bag below `root`, then the number of bags of each task."""
    table = plain_table("bag", "task", ">seconds", ">messages", ">topics", ">gaps", "problems")
    tasks: Counter[str] = Counter()
    for path, got in found:
        name = str(path.relative_to(root))
        if isinstance(got, BagError):
            table.add_row(name, *"-----", console.render_str(str(got), style="red"))
            continue
        tasks.update([part.task for part in got.demonstrations] or [got.task or "(no label)"])
        label = f"session of {len(got.demonstrations)}" if got.demonstrations else got.task
        issues = [problems(topic) for topic in got.topics]
        issues += [f"{len(got.damage)} damaged"] if got.damage else []
        issues += got.notes
        table.add_row(
            name,
            label or "(no label)",
            f"{got.duration_s:.2f}",
            str(got.message_count),
            str(len(got.topics)),
            str(sum(len(topic.gaps) for topic in got.topics)),
            ", ".join(filter(None, issues)) or "-",
        )
    console.print(table)
    counts = ", ".join(f"{task} {count}" for task, count in sorted(tasks.items()))
    console.print(f"{len(found)} bag{'s' * (len(found) != 1)}: {counts}")
    if any(isinstance(got, BagSummary) and got.damage for _, got in found):
        console.print(RECOVER, style="red")


def problems(topic: TopicSummary) -> str:
    """Counts of messages that a node would drop, that are not finite or cannot be decoded."""
    parts = [f"{count} {reason}" for reason, count in sorted(topic.rejected.items()) if count]
    if topic.not_finite and not topic.rejected.get("not_finite"):
        parts.append(f"{topic.not_finite} not finite")
    if topic.undecodable:
        parts.append(f"{topic.undecodable} undecodable")
    return ", ".join(parts)


def damage_line(damage: Damage) -> str:
    """Describe one damaged stretch of a file."""
    when = f", {moment(damage.start_ns)}" if damage.start_ns else ""
    return f"damaged at byte {damage.offset}{when}: {damage.reason}"


def moment(stamp_ns: int) -> str:
    """Date in UTC, or plain seconds for clocks that do not start in 1970."""
    if stamp_ns < 365 * 86_400 * 1_000_000_000:  # before 1971
        return f"t = {stamp_ns * 1e-9:.3f} s"
    when = datetime.fromtimestamp(stamp_ns * 1e-9, tz=timezone.utc)
    return when.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] + " UTC"


def _print_session(console: Console, summary: BagSummary) -> None:
    if summary.demonstrations:
        table = plain_table(">#", "task", ">start [s]", ">length [s]")
        for part in summary.demonstrations:
            table.add_row(
                str(part.index),
                part.task,
                f"{(part.start_ns - summary.start_ns) * 1e-9:.2f}",
                f"{(part.end_ns - part.start_ns) * 1e-9:.2f}",
            )
        console.print(table)
    for rejection in summary.unfinished:
        console.print(f"left out: {rejection.reason}", style="yellow")
