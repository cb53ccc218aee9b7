# SPDX-License-Identifier: Apache-2.0
"""Pieces of the page as HTML: bars, a table of nodes, remarks."""

import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape

from intent_recognition.dashboard.cell import (
    ASKED,
    FORCES,
    SENSOR,
    SHARE,
    SLIP,
    CellState,
    NodeHealth,
    PersonState,
    TransferState,
)
from intent_recognition.plans import LIKELY_BEFORE, WorkPlan
from intent_recognition.promp import NONE
from intent_recognition.registry import NODES
from intent_recognition.report import INK, NONE_COLOUR, PALETTE, PREDICTED_COLOUR, SOFT, readable
from intent_recognition.transfer import Holding

RULE = "#e3e8ee"
PERSON_COLOURS = ("#2b5163", "#8c3b57", "#4d6a1f", "#5b4a9c", "#7d4b1e", "#1f6e66", INK, "#6a5f6d")
"""Colours of people, in order; darker than the colours of tasks."""
FORCE_COLOURS = dict(zip((*FORCES, SENSOR), (PREDICTED_COLOUR, PALETTE[5], PALETTE[4], SOFT)))
"""Colours of forces: not those of the first tasks; the load's is that of the demo's report."""
GOOD, WARNING, BAD, STALE = "#1a9c5b", "#c47f00", "#c8362b", NONE_COLOUR
ERROR = 2
"""Level of a node in error, as in diagnostic_msgs/DiagnosticStatus."""
LEVELS = {0: GOOD, 1: WARNING, ERROR: BAD, 3: STALE}
STYLE = f"""<style>
[role=tab] {{padding-inline: .65em !important}}
@media (max-width: 36em) {{[style*='width: 20em'] {{width: 100vw !important}}
  body:not(:has([inert] .i-now)) div:has(> div > div > canvas) {{height: 42vh !important}}
  .i-notice {{bottom: calc(58vh + .6em) !important}}}}
.i-block {{font: .92em/1.4 Inter, system-ui, sans-serif; font-variant-numeric: tabular-nums;
           color: {INK}; padding: .15em 1.1em .15em .75em}}
.i-soft {{color: {SOFT}}}
.i-small {{font-size: .84em; font-weight: 400; color: {SOFT}}}
.i-bars, .i-item {{display: grid; margin: .3em 0}}
.i-bars {{grid-template-columns: minmax(0, 12em) minmax(1.5em, 1fr) 3.2em 2.6em; gap: .5em;
          align-items: center}}
.i-bars > :nth-child(n+3) {{text-align: right}}
.i-bars > .i-small {{overflow: hidden; text-overflow: ellipsis}}
.i-task {{display: flex; white-space: pre}}
.i-task > :first-child {{overflow: hidden; text-overflow: ellipsis}}
.i-bar {{background: {RULE}; border-radius: 3px; height: .95em}}
.i-bar > * {{display: block; height: 100%; border-radius: 3px}}
.i-now {{padding: .1em 0 .4em; line-height: 1.7}}
.i-row {{display: flex; flex-wrap: wrap; gap: .1em .9em; margin: .2em 0}}
.i-row > *, .i-chip {{white-space: nowrap}}
.i-banner {{color: white; border-radius: 5px; padding: .5em .75em; font-weight: 600}}
.i-notice {{position: fixed; left: 0; bottom: .6em; max-width: 28em; z-index: 100}}
.i-way {{border-left: 3px solid {RULE}; padding: .1em 0 .1em .7em; margin: .6em 0}}
.i-block code {{background: {RULE}; border-radius: 3px; font-size: .92em; padding: 0 .3em;
                overflow-wrap: anywhere}}
.i-way code {{display: block; padding: .25em .5em; margin-top: .25em}}
.i-head {{font-weight: 600; margin: .4em 0 .2em}}
.i-block table {{border-collapse: collapse; font-size: .94em}}
.i-block :is(th, td) {{padding: .2em .5em .2em 0; vertical-align: top; white-space: pre-line}}
.i-block th {{white-space: nowrap; text-align: left; color: {SOFT}; font-weight: 500}}
.i-node {{border-left: 4px solid; padding: .15em 0 .15em .6em; margin: .45em 0}}
.i-chip {{color: white; border-radius: 9px; padding: .08em .6em; font-weight: 600}}
.i-item {{grid-template-columns: 1.5em 1fr}}
.i-item > :first-child {{font-weight: 600}}
</style>"""
"""Style sheet of all pieces; in narrow windows viser's panel has the width of the window, and the
scene, while the panel is open, the height that it leaves."""
STEP_LOOKS = {
    "done": ("&#10003;", GOOD, "400"),
    "forgotten": ("!", BAD, "600"),
    "may come": ("&rarr;", INK, "600"),
}
"""Mark, colour and font weight of a plan's step, by its state; `later` has none."""
WATCHED = NODES.keys() - {"bag_player", "bag_recorder", "coworker_sim"}
"""Nodes whose silence is an alarm: no foreign ones, and none that ends when its work is done."""


def bars(
    person: PersonState, active: str, colours: Mapping[str, str], fresh: bool, head: str = ""
) -> str:
    """The task posterior as bars, with each task's phase; grey if it is old."""
    posterior = person.posterior
    if posterior is None:
        return ""
    rows = []
    for label, chance, phase in zip(
        posterior.labels, posterior.probabilities, posterior.phase, strict=True
    ):
        colour = colours.get(label, STALE) if fresh else STALE
        strong = "600" if label == posterior.best and fresh else "400"
        running = " &#9679;" if label == active and label else ""
        progress = "" if label == NONE else f"{max(float(phase), 0.0):.2f}"
        rows.append(
            f'<div class="i-bars" style="font-weight:{strong}">'
            f'<span class="i-task"><span>{escape(readable(label))}</span>'
            f'<span style="color:{colour}">{running}</span></span>'
            f'<span class="i-bar"><span style="background:{colour};'
            f'width:{100 * float(chance):.1f}%"></span></span>'
            f'<span>{float(chance):.0%}</span><span class="i-soft">{progress}</span></div>'
        )
    titles = (head or "task", "probability", "", "phase")
    cells = "".join(f'<span class="i-small">{title}</span>' for title in titles)
    return _block(f'<div class="i-bars">{cells}</div>{"".join(rows)}')


def now_line(state: CellState, colours: Mapping[str, str], people: Mapping[str, str]) -> str:
    """What the robot does or did not finish, for whom and why, and the simulated task."""
    task_chip = lambda task: chip(readable(task), colours.get(task, STALE))  # noqa: E731
    reports = [n for name, n in state.nodes.items() if name.endswith("primitive_activation")]
    trouble = next((n.message for n in reports if n.level), "")
    reason = trouble.removeprefix("idle; ").removeprefix("waits: ")
    if state.active and not reason.startswith("stopped"):
        reason = ""
    does = task_chip(state.active) if state.active else "waits"
    parts = [f'robot: {does} <span class="i-small">{escape(reason)}</span>']
    if state.helped:
        parts.append(f"for&nbsp;{chip(state.helped, people.get(state.helped, STALE))}")
    if state.unfinished and not state.active:
        task, what = state.unfinished
        parts.append(f"{task_chip(task)} <b style='color:{BAD}'>{escape(readable(what))}</b>")
    why = coworker = ""
    if state.truth is not None:  # a row of its own, so that tabs do not move when both have a task
        coworker = f"<br>coworker: {task_chip(state.truth) if state.truth else '-'}"
    if state.helped and (asked := state.asked):
        said = f"{ASKED} when this was decided: {escape(asked)}"
        why = f'<div class="i-small">{said}</div>'
    rows = " &nbsp; ".join(parts) + coworker + why
    return _block(f'<div class="i-now">{rows}</div>')


def plan(work_plan: WorkPlan | None, progress: Mapping[str, str]) -> str:
    """The steps of an assembly, the state of each, and the steps it waits for."""
    if work_plan is None:
        return ""
    names, before = work_plan.names, work_plan.before > LIKELY_BEFORE
    direct = before & ~(before @ before)
    lines = []
    for k, step in enumerate(work_plan.steps):
        now = progress.get(step.name, "")
        mark, colour, weight = STEP_LOOKS.get(now, ("", SOFT, "400"))
        after = [readable(name) for name, waits in zip(names, direct[:, k], strict=True) if waits]
        notes = [now] if now == "forgotten" else []
        notes += [f"after {', '.join(after)}"] if after else []
        notes += [f"in {step.share:.0%}"] if step.share < 1.0 else []
        note = f'<span class="i-small">{escape("; ".join(notes))}</span>'
        lines.append(_item(mark, f"{escape(readable(step.name))} {note}", colour, weight))
    return _block("".join(lines))


def transfer(state: TransferState, fresh: bool) -> str:
    """The handover's state and present forces, in their curves' colours; grey if old."""
    remarks = [f"handover: <b>{escape(state.holding)}</b>"] if state.holding else []
    offered = state.holding in (Holding.OFFERING.value, Holding.RELEASING.value)
    remarks += [f"the person carries {state.felt[SHARE]:.0%}"] if offered else []
    remarks += [f'<b style="color:{BAD}">slips</b>'] if state.felt.get(SLIP) else []
    forces = [
        swatch(f"{readable(name)} {value:.1f} N", colour if fresh else STALE)
        for name, colour in FORCE_COLOURS.items()
        if (value := state.newest(name)) is not None
    ]
    return row(remarks) + row(forces)


def row(parts: Iterable[str]) -> str:
    """Pieces of HTML side by side; empty without any."""
    spans = "".join(f"<span>{part}</span>" for part in parts)
    return _block(f'<div class="i-row">{spans}</div>') if spans else ""


def swatch(text: str, colour: str) -> str:
    """A small square in a curve's colour, and its name."""
    return f'<span style="color:{colour}">&#9632;</span> {escape(text)}'


def nodes_table(nodes: Mapping[str, NodeHealth], now_s: float) -> str:
    """Table of all nodes that have reported: state, message, rates, latency; alarms in red."""
    if not nodes:
        return remark("No node has reported yet.")
    return _block("".join(_node(name, nodes[name], now_s) for name in sorted(nodes)))


def alarms(nodes: Mapping[str, NodeHealth], now_s: float) -> list[str]:
    """The nodes that have reported but are silent now, and the first three that report an error."""
    shown = sorted(nodes.items())
    late = [name for name, health in shown if health.silent_s(now_s) and is_watched(name)]
    silent = [f"silent: {', '.join(late)}"] if late else []
    wrong = [f"{name}: {health.message}" for name, health in shown if health.level == ERROR]
    return silent + wrong[:3]


def is_watched(name: str) -> bool:
    """Whether the silence of a node is an alarm; `name` may include a namespace."""
    return name.rsplit("/", 1)[-1] in WATCHED


def remark(text: str) -> str:
    """A quiet sentence."""
    return _block(f'<span class="i-soft">{escape(text)}</span>')


def banner(text: str, colour: str = BAD) -> str:
    """A highlighted sentence."""
    return _block(f'<div class="i-banner" style="background:{colour}">{escape(text)}</div>')


def notice(text: str, colour: str = BAD) -> str:
    """A highlighted sentence in the window's corner, where it does not move the panel's buttons."""
    return f'<div class="i-notice">{banner(text, colour)}</div>'


def steps(lines: Sequence[str], done: int | None = None) -> str:
    """A numbered list of instructions, with commands between backquotes.

    The first `done` steps are ticked and the next one is highlighted; None: all look alike.
    """
    items = []
    for k, line in enumerate(lines):
        mark, colour, weight = str(k + 1), INK, "400"
        if done is not None:
            mark = "&#10003;" if k < done else mark
            colour = GOOD if k < done else INK if k == done else SOFT
            weight = "600" if k == done else "400"
        items.append(_item(mark, _with_code(line), colour, weight))
    return _block("".join(items))


def ways(title: str, lines: Sequence[str]) -> str:
    """An explanation why there is nothing to show, with the commands that help below."""
    items = "".join(f'<div class="i-way">{_with_code(line)}</div>' for line in lines)
    return _block(f'<div class="i-head">{escape(title)}</div>{items}')


def heading(text: str) -> str:
    """A small title."""
    return ways(text, ())


def table(head: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    """A small table of texts, whose cells may have several lines."""
    lines = [("th", head), *(("td", row) for row in rows)]
    cells = ("".join(f"<{kind}>{escape(text)}</{kind}>" for text in line) for kind, line in lines)
    return _block(f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>")


def _node(name: str, health: NodeHealth, now_s: float) -> str:
    silent = health.silent_s(now_s)
    alarm = silent and is_watched(name)
    colour = BAD if alarm else STALE if silent else LEVELS.get(health.level, STALE)
    silence = f"ended: {escape(health.message)}" if health.ended else f"silent for {silent:.0f} s"
    message = silence if silent else escape(health.message)
    details = "" if silent else _details(health.values)
    return (
        f'<div class="i-node" style="border-color:{colour}">'
        f'<b>{escape(name)}</b> <span style="color:{BAD if alarm else SOFT}">{message}</span>'
        f'<div class="i-small">{details}</div></div>'
    )


def _details(values: Mapping[str, str]) -> str:
    rates = [
        f"{escape(key[5:-5])} {_number(value, '.0f')} Hz"
        for key, value in values.items()
        if key.startswith("rate ")
    ][:4]
    slow = values.get("latency p99 [ms]")
    latency = [f"latency p99 {_number(slow, '.1f')} ms"] if slow else []
    rejected = [
        f'<span style="color:{WARNING}">{escape(readable(key))} {escape(value)}</span>'
        for key, value in values.items()
        if key.startswith("rejected ") and value != "0"
    ]
    return " &middot; ".join(rates + latency + rejected)


def _number(text: str, form: str) -> str:
    """The number in this format, or the text itself if it is not a number."""
    try:
        return format(float(text), form)
    except ValueError:
        return escape(text)


def chip(label: str, colour: str) -> str:
    """A white label on a coloured background."""
    return f'<span class="i-chip" style="background:{colour}">{escape(label)}</span>'


def _item(mark: str, content: str, colour: str, weight: str) -> str:
    """A list item: a mark followed by HTML."""
    return (
        f'<div class="i-item" style="color:{colour}"><span>{mark}</span>'
        f'<span style="font-weight:{weight}">{content}</span></div>'
    )


def _with_code(text: str) -> str:
    return re.sub("`(.*?)`", r"<code>\1</code>", escape(text))


def _block(content: str) -> str:
    return f'<div class="i-block">{content}</div>'
