# SPDX-License-Identifier: Apache-2.0
"""Choose a recording and play it into the graph, from any point on, at any rate."""

from collections.abc import Callable, Sequence
from pathlib import Path

import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.watch_tab import set_content
from intent_recognition.nodes.bag_player import BagPlayer

RATES = ("0.25", "0.5", "1", "2", "4")
NO_BAGS = ("There are no recordings in this folder. Start the page with `-p bags:=FOLDER`.",)
LONGEST_S = 3600.0

Play = Callable[[Path, float, float], BagPlayer]


class ReplayTab:
    """The third tab.

    Args:
        server: the page.
        bags: recordings to choose from.
        play: starts a player at (bag, offset [s], rate).
        stop: ends a player.
        do: runs a function in the thread of the graph.
        say: told how it goes.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        bags: Sequence[Path],
        play: Play,
        stop: Callable[[BagPlayer], None],
        do: Callable[[Callable], None],
        say: Callable[[bool, str], None],
    ):
        self._bags = names_of(bags)
        self._play, self._stop, self._say = play, stop, say
        self._player: BagPlayer | None = None
        gui = server.gui
        gui.add_html("" if self._bags else markup.steps(NO_BAGS))
        options = tuple(self._bags) or ("-",)
        self._bag = gui.add_dropdown("Recording", options)
        self._rate = gui.add_dropdown("Speed", RATES, initial_value="1")
        self._button = gui.add_button("Play", icon="player-play", disabled=not self._bags)
        self._at = gui.add_slider("Position [s]", 0.0, 1.0, 0.01, 0.0)
        self._told = gui.add_html("")
        self._button.on_click(lambda _: do(self._press))
        self._bag.on_update(lambda e: e.client and do(self._chosen))
        self._at.on_update(lambda e: e.client and do(self._seek))
        self._rate.on_update(lambda e: e.client and do(self._seek))

    @property
    def playing(self) -> bool:
        """Whether a recording is being played."""
        return self._player is not None

    def update(self) -> None:
        """Show how far it is; end what is over."""
        player = self._player
        if player is None:
            return
        if self._at.max != max(player.duration_s, 0.01):
            self._at.max = max(round(player.duration_s, 2), 0.01)
        self._at.value = min(round(player.position_s, 2), self._at.max)
        topics = len(list(player.publishers)) - 3
        text = f"{player.position_s:.1f} of {player.duration_s:.1f} s, {max(topics, 0)} topics"
        set_content(self._told, markup.remark(text))
        if player.finished.is_set():
            self._end()
            self._at.value = 0.0

    def close(self) -> None:
        """End what is being played."""
        if self._player is not None:
            self._end()

    def _press(self) -> None:
        if self._player is not None:
            self._end()
        else:
            self._begin(self._at.value if self._at.value < self._at.max else 0.0)

    def _chosen(self) -> None:
        self.close()
        self._at.value = 0.0

    def _seek(self) -> None:
        if self._player is not None:
            self._end()
            self._begin(self._at.value)

    def _begin(self, offset_s: float) -> None:
        self._player = self._play(
            self._bags[self._bag.value], float(offset_s), float(self._rate.value)
        )
        self._button.label, self._button.icon = "Pause", "player-pause"
        self._say(True, f"playing {self._bag.value}")

    def _end(self) -> None:
        self._stop(self._player)
        self._player = None
        self._button.label, self._button.icon = "Play", "player-play"


def names_of(paths: Sequence[Path]) -> dict[str, Path]:
    """Short names of recordings: the last three parts of their paths."""
    return {"/".join(path.parts[-3:]): path for path in paths}
