# SPDX-License-Identifier: Apache-2.0
"""Write a new bag with every message of a truncated or damaged MCAP recording that passes its
checksum. The damaged recording is not changed.

bag BAG       bag directory or .mcap file
--output BAG  directory of the new bag
--json OUT    what was saved and lost

# write a whole recording beside the damaged one
intent recover demos/give_bracket_07 --output demos/give_bracket_07_saved
"""

import argparse
from dataclasses import asdict, replace

from rich.console import Console

from intent_recognition.bags import RecoveryReport, recover
from intent_recognition.cli import output
from intent_recognition.cli.console import busy, say
from intent_recognition.cli.inspect_bag import damage_line

OPTIONS = {"output": {"required": True}}


def run(args: argparse.Namespace) -> int:
    """Recover a bag, and print what was saved and what was lost."""
    output.check_outputs(args)
    with busy(Console(stderr=True), "recovering"):
        report = recover(args.bag, args.output)
    output.write_json(args.json, report_json(report))
    say(output.table_console(args), "\n".join(report_lines(report)))
    return 0


def report_json(report: RecoveryReport) -> dict:
    """The report as plain values."""
    counts = dict(report.message_counts)
    return asdict(replace(report, message_counts=counts)) | {"message_count": report.message_count}


def report_lines(report: RecoveryReport) -> list[str]:
    """Lines with what was saved, topic by topic, and what was lost."""
    span_s = (report.end_ns - report.start_ns) * 1e-9
    width = max(map(len, report.message_counts), default=0)
    saved = [f"  {topic.ljust(width)}  {n}" for topic, n in sorted(report.message_counts.items())]
    lost = [damage_line(damage) for damage in report.damage] or ["nothing was damaged"]
    return [
        f"saved {report.message_count} messages over {span_s:.2f} s in {report.output}",
        *saved,
        *lost,
        *(f"note: {note}" for note in report.notes),
    ]
