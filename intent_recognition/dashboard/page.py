# SPDX-License-Identifier: Apache-2.0
"""The page: one server, one scene, six tabs."""

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from itertools import cycle
from pathlib import Path

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.admission import Admission, Operator, new_token
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import Commands
from intent_recognition.dashboard.compare_tab import CompareTab
from intent_recognition.dashboard.replay_tab import Play, ReplayTab
from intent_recognition.dashboard.scene import PageScene
from intent_recognition.dashboard.scene_file import CellScene
from intent_recognition.dashboard.server import serve_page
from intent_recognition.dashboard.skills_tab import SkillsTab
from intent_recognition.dashboard.teach_tab import TeachTab
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.dashboard.via_controls import ViaPointControls
from intent_recognition.dashboard.watch_tab import WatchTab
from intent_recognition.dashboard.welcome import ALWAYS, AUTO, NEVER
from intent_recognition.dashboard.widgets import PageAccess
from intent_recognition.errors import IntentError, one_line
from intent_recognition.report import INK, task_colours

TITLE = "intent recognition"


class DashboardPage:
    """Shows a cell and passes on what is pressed; call `update` at the rate of the page.

    Callbacks run in the page's threads; `update`, called by the graph's thread, carries out what
    they ask for. Without `hand_link` the hand is the link with the most joints above it; `welcome`
    describes `light`.

    Attributes:
        address: address that the operator opens, with the token.

    Raises:
        ResourceBusyError: the port is taken.
        ArgumentError: the token in the environment variable cannot be used.
    """

    def __init__(
        self,
        host: str,
        port: int,
        state: CellState,
        commands: Commands,
        teleoperation: Teleoperation,
        session: TeachingSession,
        *,
        bags: Sequence[Path],
        models: Callable[[], Sequence[Path]],
        play: Play,
        stop: Callable,
        scene: CellScene | None = None,
        hand_link: str = "",
        names: Iterable[str] = (),
        read_only: bool = False,
        light: str = AUTO,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._state, self._commands, self._clock = state, commands, clock
        self._asked: dict[Callable[[], None], None] = {}
        self._asking = threading.Lock()
        self._message_until_s = -1.0
        self._panel_at_s = self._slow_at_s = -1.0
        self._colours: dict[str, str] = {}
        self._of_model: dict[str, str] = {}
        self._seen: tuple[str, ...] = ()
        self._taught = ""
        admission, operator = Admission(host, port, new_token(), names), Operator(read_only)

        def refuse() -> None:
            self.show_message(False, operator.refusal)

        # one object each, so that `_ask` counts repeated requests once; there is no scene yet
        looks = (lambda: self._scene.shade(), lambda: self._scene.lighten())
        self.address = admission.address
        self._server = serve_page(
            host,
            port,
            TITLE,
            admission,
            operator,
            lambda why: self._ask(refuse),
            light,
            lambda slow: self._ask(looks[slow]),
        )
        cell = scene or CellScene()
        self._scene: PageScene = PageScene(self._server, cell, hand_link, light == ALWAYS)
        if light == NEVER:
            self._scene.shade()
        gui = self._server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(400.0)
        gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=(72, 104, 130),  # a slate that is no task's colour
        )
        gui.set_panel_label(TITLE)
        gui.add_html(markup.STYLE)
        self._banner = gui.add_html("", visible=False)
        self._now = gui.add_html("", visible=False)
        tabs = gui.add_tab_group()
        access = PageAccess(self._server, commands, self._ask)
        with tabs.add_tab("Watch") as tab:
            self._watch = WatchTab(access, tab)
            self._via = ViaPointControls(access)
        with tabs.add_tab("Teach"):
            self._teach = TeachTab(access, teleoperation, session)
        with tabs.add_tab("Skills"):
            self._skills = SkillsTab(access)
        with tabs.add_tab("Replay"):
            self._replay = ReplayTab(access, bags, play, stop)
        with tabs.add_tab("Compare"):
            self._compare = CompareTab(self._server, bags, models, lambda: self._colours)
        with tabs.add_tab("Nodes"):
            self._nodes = gui.add_html("")

    def show_message(self, ok: bool, text: str) -> None:
        """Show a notification for a few seconds; failures stand out."""
        if not text:
            return
        colour = INK if ok else markup.WARNING
        self._banner.content = markup.notice(text, colour)
        self._banner.visible = True
        self._message_until_s = self._clock() + 6.0

    def update(self) -> None:
        """Carry out what was asked for, and show the newest state."""
        with self._asking:
            asked, self._asked = self._asked, {}
        for action in asked:
            try:
                action()
            except (IntentError, LookupError, ValueError, TypeError, ArithmeticError) as error:
                self.show_message(False, one_line(error))  # a browser may send nonsense
        with self._server.atomic():  # one transmission: each has a fixed cost
            self._show()

    def _show(self) -> None:
        now_s = self._clock()
        state = self._state
        self._choose_colours()
        people = dict(zip(filter(None, state.people), cycle(markup.PERSON_COLOURS)))
        problem = self._scene.update(state, self._colours, people, now_s)
        if now_s - self._panel_at_s >= 0.1:
            self._panel_at_s = now_s
            self._now.visible = bool(state.joints) or state.believes
            self._now.content = markup.now_line(state, self._colours, people)
            self._watch.update(state, self._colours, people, now_s)
            self._via.update(state.via_points, self._scene.hand_path)
            self._teach.update(state)
            self._replay.update()
        if now_s - self._slow_at_s >= 1.0:
            self._slow_at_s = now_s
            self._update_slowly(now_s, problem)

    def close(self) -> None:
        """Stop serving."""
        self._replay.close()
        self._server.stop()

    def _ask(self, action: Callable[[], None]) -> None:
        """Queue an action for the next update; repeated requests until then count once."""
        with self._asking:
            self._asked[action] = None
            if len(self._asked) > 200:  # about a second of drags
                del self._asked[next(iter(self._asked))]

    def _choose_colours(self) -> None:
        """One colour per task, as in the reports; a task of the model keeps its colour."""
        people = self._state.people.values()
        labels = next((person.posterior.labels for person in people if person.posterior), ())
        seen = (*labels, self._state.truth or "", self._state.active)
        if seen != self._seen:
            self._seen = seen
            self._of_model = task_colours(labels, self._of_model)
            self._colours = task_colours(seen, self._of_model)

    def _update_slowly(self, now_s: float, problem: str) -> None:
        self._commands.give_up_lost()
        self._watch.update_controls()
        self._skills.update(self._state)
        if self._state.teaching != self._taught:  # only then may there be new models
            self._taught = self._state.teaching
            self._compare.refresh()
        self._nodes.content = markup.nodes_table(self._state.nodes, now_s)
        if now_s < self._message_until_s:
            return
        wrong = [*markup.alarms(self._state.nodes, now_s), *filter(None, [problem])]
        self._banner.visible = bool(wrong)
        self._banner.content = markup.notice("; ".join(wrong))
