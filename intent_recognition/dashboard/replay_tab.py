# SPDX-License-Identifier: Apache-2.0
"""Tab to play a recording into the graph, from any point and at any rate."""

from collections.abc import Callable, Sequence
from pathlib import Path

import viser

from intent_recognition.bags import read_metadata
from intent_recognition.dashboard import markup
from intent_recognition.dashboard.commands import ESTIMATOR
from intent_recognition.dashboard.widgets import PageAccess, set_value, slider_value
from intent_recognition.errors import BagError
from intent_recognition.nodes.bag_player import BagPlayer

RATES = {"0.25 x": 0.25, "0.5 x": 0.5, "1 x": 1.0, "2 x": 2.0, "4 x": 4.0}
NO_BAGS = ("Name another: `-p bags:=FOLDER`", "Or record one: `intent record --output BAG`")
SHOWN_ONLY = "No estimator runs: a recording is shown, but no task recognised."
START_ESTIMATOR = ("Start one: `ros2 launch intent_recognition intent.launch.py model:=M.npz`",)

Play = Callable[[Path, float, float], BagPlayer]


class ReplayTab:
    """Plays recordings to the running nodes."""

    def __init__(
        self, page: PageAccess, bags: Sequence[Path], play: Play, stop: Callable[[BagPlayer], None]
    ):
        self._bags = names_of(bags)
        self._play, self._stop, self._commands = play, stop, page.commands
        self._player: BagPlayer | None = None
        gui = page.server.gui
        gui.add_html("" if self._bags else markup.ways("This folder has no recordings.", NO_BAGS))
        self._hint = gui.add_html("")
        self._bag = gui.add_dropdown("Recording", tuple(self._bags) or ("-",))
        self._facts = gui.add_html("")
        self._rate = gui.add_dropdown("Speed", tuple(RATES), initial_value="1 x")
        self._at = gui.add_slider("Position [s]", 0.0, 1.0, 0.01, 0.0)
        self._button = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
        page.on_click(self._button, self._press)
        page.on_change(self._bag, self._chosen)
        page.on_change(self._at, self._seek)
        page.on_change(self._rate, self._seek)
        for field in (self._bag, self._rate, self._at, self._button):
            field.visible = bool(self._bags)
        if self._bags:
            self._describe()

    def update(self) -> None:
        """Show the position in the recording; stop the player at its end."""
        present = self._commands.offers(f"{ESTIMATOR}/reset") or not self._bags
        self._hint.content = "" if present else markup.ways(SHOWN_ONLY, START_ESTIMATOR)
        player = self._player
        if player is None:
            return
        self._set_length(player.duration_s)
        set_value(self._at, min(round(player.position_s, 2), self._at.max))
        if player.finished.is_set():
            self.close()
            set_value(self._at, 0.0)

    def _press(self) -> None:
        if self._player is not None:
            self.close()
        else:
            at_s = slider_value(self._at)
            self._begin(at_s if at_s < self._at.max else 0.0)

    def _chosen(self) -> None:
        self.close()
        set_value(self._at, 0.0)
        self._describe()

    def _describe(self) -> None:
        """Show the task, length and topics of the chosen recording."""
        try:
            found = read_metadata(self._bags[self._bag.value])
        except BagError as error:
            self._facts.content = markup.banner(str(error), markup.WARNING)
            return
        self._set_length(found.duration_ns * 1e-9)
        task = found.custom_data.get("task", "")
        facts = [f"task {task.replace('_', ' ')}"] if task else []
        facts += [f"{found.duration_ns * 1e-9:.1f} s"]
        facts += sorted(topic.name.lstrip("/") for topic in found.topics)
        self._facts.content = markup.remark(", ".join(facts))

    def _set_length(self, seconds: float) -> None:
        self._at.max = max(round(seconds, 2), 0.01)

    def _seek(self) -> None:
        if self._player is not None:
            self.close()
            self._begin(slider_value(self._at))

    def _begin(self, offset_s: float) -> None:
        bag = self._bags[self._bag.value]
        self._player = self._play(bag, offset_s, RATES[self._rate.value])
        self._button.label, self._button.icon = "Pause", viser.Icon.PLAYER_PAUSE
        self._commands.notify(True, f"playing {self._bag.value}")

    def close(self) -> None:
        """Stop the recording being played."""
        if self._player is None:
            return
        self._stop(self._player)
        self._player = None
        self._button.label, self._button.icon = "Play", viser.Icon.PLAYER_PLAY


def names_of(paths: Sequence[Path]) -> dict[str, Path]:
    """Short names of recordings: the last three parts of their paths."""
    return {"/".join(path.parts[-3:]): path for path in paths}
