# SPDX-License-Identifier: Apache-2.0
"""Find the interactions in a recording of several, and write each as a bag: labelled with --model,
otherwise cut by the motion of both agents. Markers in the session are not used.

session SESSION  one bag, or its .mcap file
--dofs F         DOF file, where no model is given (default: the shipped config/dofs.yaml)
--output BAGS    folder of the new bags (default: %(default)s)
--json OUT       the segments

who finds the tasks, one of:
--model M.npz  model that finds and labels the tasks
--unlabelled   cut by motion alone (the default without --model)

# cut where both agents rest, then find the tasks
intent segment sessions/monday --unlabelled --output demos
# then learn from them
intent train demos --unlabelled --output model.npz
# cut and label by what is known already
intent segment sessions/monday --model model.npz --output demos
"""

import argparse
from pathlib import Path

from intent_recognition.cli import output
from intent_recognition.cli.console import busy, plain_table, say
from intent_recognition.demonstrations import load_dofs, settle_orientations
from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation import propose_segments, recognise_segments, write_segments
from intent_recognition.model import load_model

OPTIONS = {"output": {"default": Path("out/segments")}}


def run(args: argparse.Namespace) -> int:
    """Segment a session, write the bags and print the segments."""
    console = output.console_beside(args)
    if args.model and args.dofs:
        cure = "Leave one of them out: a model has its own DOFs."
        raise ArgumentError.about("--dofs", "no --model with it", args.model, cure)
    with busy(console, "segmenting"):
        if args.model:
            model = load_model(args.model)
            dofs, segments = model.dofs, recognise_segments(args.session, model)
        else:
            dofs = settle_orientations(load_dofs(args.dofs), args.session)
            segments = propose_segments(args.session, dofs)
        bags = write_segments(args.session, dofs, segments, args.output)
    content = [
        segment._asdict() | {"bag": str(bag)} for segment, bag in zip(segments, bags, strict=True)
    ]
    output.write_json(args.json, content)
    if args.json != output.PRINTED and segments:
        table = plain_table("bag", ">from [s]", ">to [s]", "task")
        for segment, bag in zip(segments, bags, strict=True):
            at = [f"{(ns - segments[0].start_ns) * 1e-9:.2f}" for ns in segment[:2]]
            table.add_row(bag.name, *at, segment.task or "-")
        console.print(table)
    say(console, f"{len(bags)} demonstration{'s' * (len(bags) != 1)} in {args.output}")
    return 0
