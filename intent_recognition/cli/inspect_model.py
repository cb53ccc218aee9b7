# SPDX-License-Identifier: Apache-2.0
"""Models in `intent inspect`: as tables, and as plain values for JSON."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.console import Console

from intent_recognition.cli.console import boxed_table, plain_table, print_facts
from intent_recognition.errors import first_of
from intent_recognition.model import FRAMES, Frames, Model, frames_of
from intent_recognition.promp import TaskLibrary, least_end_std
from intent_recognition.recognition import MAX_SWITCHED, DecisionSettings, learned_risk

MEANINGS: Mapping[str, Mapping[str, str]] = {
    "settings": {"ridge": " (smoothness of what is learned)"},
    "chosen": {
        "ridge": " (of slopes from demonstrations alone; 0: other slopes)",
        "score": " (of log loss and error, less is better)",
    },
}
"""Explanations of words in the provenance, by part."""


def model_json(model: Model) -> dict:
    """A model as plain values, without its large arrays."""
    library = model.library
    names, context = (*library.observed_names, *library.controlled_names), library.context
    return {
        "tasks": {
            label: {
                "n_demonstrations": int(library.n_demonstrations[k]),
                "median_duration_s": float(library.durations_s[k]),
                "log_duration_std": float(library.log_duration_std[k]),
                "prior": float(library.task_prior[k]),
                "least_end_std": least_end_std(library, k),
            }
            for k, label in enumerate(library.labels)
        },
        "observed": dict(zip(library.observed_names, library.observed_units, strict=True)),
        "controlled": dict(zip(library.controlled_names, library.controlled_units, strict=True)),
        "context": dict(zip(library.context_names, context.units)) if context else {},
        "noise_std": dict(zip(names, map(float, library.noise_variance**0.5), strict=True)),
        "n_basis": library.basis.n_basis,
        "noise_scale": library.noise_scale,
        "largest_phase_deviation": float(library.phase_deviation.deviation_std.max()),
        "controlled_follows": library.phase_deviation.controlled_follows,
        "none_margin": library.none_margin,
        "stop_margin": library.stop_margin,
        "switch_margin": library.switch_margin,
        "left_out_odds": library.left_out_odds._asdict(),
        "correlation_time_s": library.correlation_time_s,
        "none_prior": library.none_prior,
        "dofs": model.dofs.to_dict(),
        "provenance": dict(library.provenance),
    }


def _progress(library: TaskLibrary) -> str:
    deviation = library.phase_deviation
    largest = f"phase deviations of {100 * deviation.deviation_std.max():.2g} % of the movement"
    follows = "follows them" if deviation.controlled_follows else "keeps steady progress"
    return f"{largest}; the controlled agent {follows}"


def _in_frames(frames: Frames) -> str:
    if len(set(frames.values())) == 1:
        return f"frame {' and '.join(next(iter(frames.values())))}"
    return ", ".join(f"{topic} in {' and '.join(found)}" for topic, found in frames.items())


def print_model(console: Console, path: Path, model: Model) -> None:
    """Print the tasks of a model, its accuracy and its provenance."""
    library = model.library
    origin = dict(library.provenance)
    named = origin.pop("bags", ())
    bags = [str(bag) for bag in (named if isinstance(named, (list, tuple)) else [named])]
    frames, _ = frames_of(library), origin.pop(FRAMES, None)
    counts = origin.pop("transition_counts", None)
    facts = {
        "model": str(path),
        "basis": f"{library.basis.n_basis} functions per degree of freedom",
        "none": f"prior {library.none_prior:.3g}, margin {library.none_margin:.3g} nats"
        " (evidence that a known task must have over it)",
        "change of mind": f"margin {library.switch_margin:.3g} nats (evidence that it must have"
        f" over staying with the task); takes over from {DecisionSettings().switch_threshold:.3f},"
        f" wrongly in at most {MAX_SWITCHED:.0%} of movements",
        **({"risk": str(risk)} if (risk := learned_risk(library)) else {}),
        "noise": f"scale {library.noise_scale:.3g}, correlated over"
        f" {library.correlation_time_s:.3g} s",
        "progress": _progress(library),
        **({"recorded in": _in_frames(frames)} if frames else {}),
        **{key: _brief(value, MEANINGS.get(key, {})) for key, value in origin.items()},
    }
    print_facts(console, facts)
    durations = (">median [s]", ">95 % in [s]")
    tasks = plain_table("task", ">demonstrations", *durations, ">prior", ">least end std")
    about, width = library.log_duration_mean, 2 * library.log_duration_std
    low, high = np.exp(about - width), np.exp(about + width)
    for k, label in enumerate(library.labels):
        tasks.add_row(
            label,
            str(int(library.n_demonstrations[k])),
            f"{library.durations_s[k]:.2f}",
            f"{low[k]:.2f} to {high[k]:.2f}",
            f"{library.task_prior[k]:.3f}",
            ", ".join(f"{std:.3f} {unit}" for unit, std in least_end_std(library, k).items()),
        )
    console.print(tasks)
    dofs = plain_table("agent", "degree of freedom", "unit", ">noise std")
    rows = (
        *(("observed", n, u) for n, u in zip(library.observed_names, library.observed_units)),
        *(("controlled", n, u) for n, u in zip(library.controlled_names, library.controlled_units)),
    )
    for (agent, name, unit), variance in zip(rows, library.noise_variance, strict=True):
        dofs.add_row(agent, name, unit, f"{np.sqrt(variance):.4f}")
    if (context := library.context) is not None:
        for name, unit in zip(context.names, context.units, strict=True):
            dofs.add_row("context", name, unit, "-")
    console.print(dofs)
    if bags:
        console.print(f"from {len(bags)} bags: {first_of(bags)}")
    if counts is not None:
        print_transitions(console, library, "learned from sessions")


def print_transitions(console: Console, library: TaskLibrary, source: str) -> None:
    """Print a table of the transition probabilities p(next | last)."""
    table = boxed_table(
        f"which task follows which, {source}", "after", *(f">{label}" for label in library.labels)
    )
    for label, row in zip((*library.labels, "no task"), library.transition_prior, strict=True):
        table.add_row(label, *(f"{p:.2f}" for p in row))
    console.print(table)


def _brief(value: object, meanings: Mapping[str, str] = {}) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_brief(item)}{meanings.get(k, '')}" for k, item in value.items())
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(_brief(item) for item in value) + ")"
    return str(value)
