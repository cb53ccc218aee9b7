# SPDX-License-Identifier: Apache-2.0
"""Write each demonstration of a file, a folder of files or a data set as a bag, and a DOF file
beside them. The map says which columns are which degrees of freedom, where times come from, and
where a demonstration begins and ends: docs/import.md. --suggest writes a first one.

source SOURCE   a file, a folder of files, or a data set
--map MAP.yaml  map of the columns
--output BAGS   folder of the new bags; with --suggest the file of the map
--suggest       write or print a first map by what SOURCE holds, with comments; import nothing

# a first map to correct
intent import take.csv --suggest --output map.yaml
# two files for each recording, as the map says
intent import handover_csv --map config/maps/baton.yaml --output out/baton
# then score them
intent evaluate out/baton --dofs out/baton/dofs.yaml --protocol kfold:5
"""

import argparse
import sys
from collections import Counter

import yaml

from intent_recognition.cli import output
from intent_recognition.cli.console import busy, make_console, plain_table, say
from intent_recognition.cli.recordings import DOFS
from intent_recognition.cli.rejections import nothing_of, print_doubtful, print_left_out
from intent_recognition.errors import ArgumentError
from intent_recognition.signals import Rejection
from intent_recognition.tables import (
    Doubt,
    ImportedDemonstration,
    import_demonstrations,
    load_map,
    suggest_map,
)


def run(args: argparse.Namespace) -> int:
    """Import, write the bags and the DOF file, and print what was found and left out."""
    if args.suggest:
        text = suggest_map(args.source)
        if args.output is None:
            sys.stdout.write(text)
        else:
            output.check_output("--output", args.output)
            output.check_new(args.output, text)
            args.output.parent.mkdir(parents=True, exist_ok=True)
            args.output.write_text(text, encoding="utf-8")
            say(make_console(), f"wrote {args.output}")
        return 0
    if args.map is None or args.output is None:
        option = "--map" if args.map is None else "--output"
        cure = "intent import SOURCE --suggest writes a first map."
        raise ArgumentError.about(option, "a path", "none", cure)
    console = make_console()
    mapping = load_map(args.map)
    dofs = args.output / DOFS
    content = mapping.dofs.to_dict()
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)
    output.check_new(dofs, text)
    left_out: list[Rejection] = []
    table = plain_table("bag", "task", ">messages", ">not measured", ">dropped")
    totals: Counter[str] = Counter()
    count = n_unlabelled = 0
    with busy(console, "importing"):
        for found in import_demonstrations(args.source, mapping):
            if isinstance(found, Rejection):
                left_out.append(found)
                continue
            written = found.write(args.output)
            if not written:
                why = "no message between start and end of its segment", "Correct the map."
                left_out.append(Rejection(found.name, "", 0, *why))
                continue
            totals.update(written)
            count += 1
            n_unlabelled += "task" not in found.custom_data
            messages = " + ".join(map(str, written.values()))
            row = [found.name, found.custom_data.get("task", "-"), messages]
            if isinstance(found, ImportedDemonstration):
                row += [str(found.not_measured(written)), str(found.n_dropped)]
            table.add_row(*row)
    if not count:
        raise nothing_of(str(args.source), "demonstrations", left_out, "Correct the map.")
    dofs.write_text(text, encoding="utf-8")
    console.print(table)
    print_left_out(console, [one for one in left_out if not isinstance(one, Doubt)])
    print_doubtful(console, [one for one in left_out if isinstance(one, Doubt)])
    for topic, total in sorted(totals.items()):
        say(console, f"{topic}: {total} messages")
    made = f"{count} demonstration{'s' * (count != 1)} in {args.output}"
    say(console, f"{made}; learn from them with --dofs {dofs}")
    if n_unlabelled:
        cure = "name it under task or files in the map, or learn with --unlabelled"
        say(console, f"{n_unlabelled} without a task: {cure}", "yellow")
    return 0
