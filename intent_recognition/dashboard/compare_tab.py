# SPDX-License-Identifier: Apache-2.0
"""Tab that runs two models on one recording and shows both posteriors and both decisions."""

import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.bags import BagReader
from intent_recognition.dashboard import markup
from intent_recognition.dashboard.replay_tab import names_of
from intent_recognition.dashboard.widgets import series_of, time_plot
from intent_recognition.errors import IntentError, one_line
from intent_recognition.evaluation import explain, replay
from intent_recognition.model import load_model
from intent_recognition.report import heading, readable, short_name, task_colours, without_rows

ABOUT = (
    "Both models replay one recording: which recognises the task sooner, and with more certainty?"
)
CURES = (
    "Train one, and start the page where it lies: `intent train BAG... --output M.npz`",
    "Or name their folder: `-p models:=FOLDER`",
)


class CompareTab:
    """Runs models on a recording in a separate thread, independently of the live topics."""

    def __init__(
        self,
        server: viser.ViserServer,
        bags: Sequence[Path],
        models: Callable[[], Sequence[Path]],
        colours: Callable[[], Mapping[str, str]],
    ):
        self._gui, self._colours = server.gui, colours
        self._bags, self._find = names_of(bags), models
        self._models = names_of(models())
        self._hint = self._gui.add_html(self._about())
        names = tuple(self._models) or ("-",)
        self._bag = self._gui.add_dropdown("Recording", tuple(self._bags) or ("-",))
        self._chosen = [
            self._gui.add_dropdown("Model A", names),
            self._gui.add_dropdown("Model B", names, initial_value=names[-1]),
        ]
        self._button = self._gui.add_button("Compare", icon=viser.Icon.ARROWS_LEFT_RIGHT)
        self._result = self._gui.add_html("")
        self._plots: list[viser.GuiUplotHandle] = []
        self._place = self._gui.add_folder("Probability over time", visible=False)
        self._button.on_click(lambda _: self._start())
        self._show_fields()

    def refresh(self) -> None:
        """Look for new models and offer them."""
        found = names_of(self._find())
        if found.keys() != self._models.keys() and found:
            self._models = found
            self._hint.content = self._about()
            for field in self._chosen:
                field.options = tuple(found)
            self._show_fields()

    def _start(self) -> None:
        self._button.disabled = True
        self._result.content = markup.remark("Both are watching the recording ...")
        threading.Thread(target=self._run, name="compare", daemon=True).start()

    def _show_fields(self) -> None:
        """Show the fields only if there is a model and a recording to choose."""
        for field in (self._bag, *self._chosen, self._button):
            field.visible = bool(self._models and self._bags)

    def _about(self) -> str:
        if not self._models:
            return markup.ways("There is no model to compare.", CURES)
        return markup.remark(ABOUT)

    def _run(self) -> None:
        try:
            self._compare()
        except Exception as error:
            self._result.content = markup.banner(one_line(error), markup.WARNING)
            if not isinstance(error, IntentError | KeyError):
                raise
        finally:
            self._button.disabled = False

    def _compare(self) -> None:
        bag = self._bags[self._bag.value]
        models = [self._models[field.value] for field in self._chosen]
        found = [posterior_over(bag, model) for model in models]
        named = {m: " and ".join(n for n, o in zip("AB", models) if o == m) for m in models}
        reasons = "".join(why_over(bag, model, name) for model, name in named.items())
        colours = self._draw(found)
        names = markup.row(markup.swatch(readable(one), colour) for one, colour in colours.items())
        rows = [(n, *summary) for n, (_, _, summary) in zip("AB", found, strict=True)]
        table = markup.table(("model", "acts on", "after", "at the end"), rows)
        self._result.content = table + reasons + names

    def _draw(self, found: Sequence[tuple]) -> dict[str, str]:
        """Draw one diagram per model on the same time axis; return the colour of each label."""
        labels = {label for _, columns, _ in found for label in columns}
        taken = self._colours()
        colours = task_colours(labels | taken.keys(), taken)
        last_s = max(float(times[-1]) for times, _, _ in found)
        while self._plots:
            self._plots.pop().remove()
        with self._place:
            for name, (times, columns, _) in zip("AB", found, strict=True):
                data, series = (times, *columns.values()), series_of(tuple(columns), colours)
                title = f"probability, model {name}"
                plot = time_plot(self._gui, data, series, times_s=(0.0, last_s), title=title)
                self._plots.append(plot)
        self._place.visible = True
        return {label: colours[label] for label in sorted(labels)}


def posterior_over(
    bag: Path, model: Path
) -> tuple[Floats, dict[str, Floats], tuple[str, str, str]]:
    """Posterior of a model over a recording: times (T,) [s], probabilities (T,) per task, summary.

    Raises:
        IntentError: bag or model cannot be used, or they do not fit each other.
    """
    rows = list(replay(BagReader(bag, tolerant=True), load_model(model)))
    stamps = np.array([row["stamp"] for row in rows])
    times = (stamps - stamps[0]) * 1e-9
    labels = tuple(rows[0]["probabilities"])
    every = max(1, len(rows) // 400)
    columns = {
        label: np.array([row["probabilities"][label] for row in rows[::every]]) for label in labels
    }
    acted = next((k for k, row in enumerate(rows) if row["active_task"]), None)
    moving = [row for row in rows if any(row["phase"].values())]
    last = (moving or rows)[-1]["probabilities"]
    best = max(last, key=last.get)
    summary = (
        "nothing" if acted is None else readable(rows[acted]["active_task"]),
        "-" if acted is None else f"{times[acted]:.2f} s",
        f"{readable(best)} {last[best]:.0%}",
    )
    return times[::every], columns, summary


def why_over(bag: Path, model: Path, name: str) -> str:
    """Explanation of a model's first decision in a recording, as HTML; empty without movement.

    Raises:
        IntentError: bag or model cannot be used, or they do not fit each other.
    """
    found = explain(BagReader(bag, tolerant=True), load_model(model))
    if not found:
        return ""
    one = next((one for one in found if one.task), found[0])
    names = one.evidence.names
    rows = [
        (short_name(name, names), "" if added is None else f"{added:+.1f}", instead)
        for name, added, instead in without_rows(one)
    ]
    table = markup.table(("signal", "nats", "without it"), rows)
    return markup.remark(f"model {name}: {heading(one)}") + table
