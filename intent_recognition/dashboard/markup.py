# SPDX-License-Identifier: Apache-2.0
"""Pieces of the page as HTML text: bars, a table of nodes, remarks."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from intent_recognition.dashboard.cell import CellState, NodeHealth
from intent_recognition.promp import NONE
from intent_recognition.report import INK, NONE_COLOUR, SOFT, readable

RULE = "#e3e8ee"
GOOD, WARNING, BAD, STALE = "#1a9c5b", "#c47f00", "#c8362b", NONE_COLOUR
LEVELS = {0: GOOD, 1: WARNING, 2: BAD, 3: STALE}
FONT = "font-family:Inter,system-ui,sans-serif;font-variant-numeric:tabular-nums"
COLUMNS = "9.2em 1fr 3.2em 3em"
MAY_END = frozenset({"bag_player", "bag_recorder", "coworker_sim"})
"""Nodes that end when their work is done: their silence is no alarm."""


def bars(state: CellState, colours: Mapping[str, str], fresh: bool) -> str:
    """The task posterior as bars, with the phase of each task; grey where it is old."""
    posterior = state.posterior
    if posterior is None:
        return ""
    rows = []
    for label, chance, phase in zip(
        posterior.labels, posterior.probabilities, posterior.phase, strict=True
    ):
        colour = colours.get(label, STALE) if fresh else STALE
        strong = "600" if label == posterior.best and fresh else "400"
        running = " &#9679;" if label == state.active and label else ""
        progress = "" if label == NONE else f"{max(float(phase), 0.0):.2f}"
        rows.append(
            f'<div style="display:grid;grid-template-columns:{COLUMNS};gap:.5em;'
            f'align-items:center;margin:.3em 0;font-weight:{strong}">'
            f'<span style="overflow:hidden;text-overflow:ellipsis;white-space:nowrap">'
            f"{escape(readable(label))}<span style='color:{colour}'>{running}</span></span>"
            f'<span style="background:{RULE};border-radius:3px;height:.95em">'
            f'<span style="display:block;height:100%;border-radius:3px;background:{colour};'
            f'width:{100 * float(chance):.1f}%"></span></span>'
            f'<span style="text-align:right">{float(chance):.0%}</span>'
            f'<span style="text-align:right;color:{SOFT}">{progress}</span></div>'
        )
    small = f"font-size:.84em;color:{SOFT}"
    head = (
        f'<div style="display:grid;grid-template-columns:{COLUMNS};gap:.5em">'
        f'<span style="{small}">task</span><span style="{small}">probability</span><span></span>'
        f'<span style="{small};text-align:right">phase</span></div>'
    )
    return _block(head + "".join(rows))


def now_line(state: CellState, colours: Mapping[str, str]) -> str:
    """What the robot does or did not finish, and what the simulated coworker does, if published."""
    parts = [f"robot: {_chip(state.active, colours) if state.active else 'waits'}"]
    if state.unfinished and not state.active:
        task, what = state.unfinished
        parts.append(f"{_chip(task, colours)} <b style='color:{BAD}'>{escape(what)}</b>")
    if state.truth:
        parts.append(f"coworker: {_chip(state.truth, colours)}")
    return _block(f'<div style="padding:.25em 0 .55em">{" &nbsp; ".join(parts)}</div>')


def plan(steps: Mapping[str, str]) -> str:
    """The steps of an assembly, a line each for what is done, forgotten, may come, and is later."""
    rows = [
        f"<div style='margin:.2em 0{f';color:{BAD}' if what == 'forgotten' else ''}'>"
        f"<span style='color:{SOFT}'>{what}:</span> {escape(', '.join(map(readable, names)))}</div>"
        for what in ("done", "forgotten", "may come", "later")
        if (names := [name for name, now in steps.items() if now == what])
    ]
    return _block("".join(rows)) if rows else ""


def nodes_table(nodes: Mapping[str, NodeHealth], now_s: float) -> str:
    """Every node that ever reported: state, message, rates, latency; silent ones stand out."""
    if not nodes:
        return remark("No node has reported yet.")
    return _block("".join(_node(name, nodes[name], now_s) for name in sorted(nodes)))


def silent_nodes(nodes: Mapping[str, NodeHealth], now_s: float) -> list[str]:
    """Names of nodes that reported once and are silent now."""
    return sorted(
        name for name, health in nodes.items() if health.silent_s(now_s) > 0.0 and not may_end(name)
    )


def may_end(name: str) -> bool:
    """Whether a node ends by itself; `name` may have a namespace."""
    return name.rsplit("/", 1)[-1] in MAY_END


def remark(text: str) -> str:
    """A quiet sentence."""
    return _block(f'<span style="color:{SOFT}">{escape(text)}</span>')


def banner(text: str, colour: str = BAD) -> str:
    """A sentence that must be seen."""
    return _block(
        f'<div style="background:{colour};color:white;border-radius:5px;padding:.5em .75em;'
        f'font-weight:600">{escape(text)}</div>'
    )


def steps(lines: Sequence[str], done: int | None = None) -> str:
    """What to do, numbered; commands between backquotes.

    Args:
        lines: the steps.
        done: so many are done and ticked, the next one stands out; None: all are alike.
    """
    items = []
    for k, line in enumerate(lines):
        mark, colour, weight = str(k + 1), INK, "400"
        if done is not None:
            mark = "&#10003;" if k < done else mark
            colour = GOOD if k < done else INK if k == done else SOFT
            weight = "600" if k == done else "400"
        items.append(
            f'<div style="display:grid;grid-template-columns:1.5em 1fr;margin:.3em 0;'
            f'color:{colour}"><span style="font-weight:600">{mark}</span>'
            f'<span style="font-weight:{weight}">{_with_code(line)}</span></div>'
        )
    return _block("".join(items))


def ways(title: str, lines: Sequence[str]) -> str:
    """Why there is nothing to show, and what to do about it, commands below."""
    items = "".join(
        f'<div style="border-left:3px solid {RULE};padding:.1em 0 .1em .7em;margin:.6em 0">'
        f"{_with_code(line, 'display:block;padding:.25em .5em;margin-top:.25em')}</div>"
        for line in lines
    )
    return _block(f'<div style="font-weight:600;margin:.2em 0 .4em">{escape(title)}</div>{items}')


def heading(text: str) -> str:
    """A small title."""
    return _block(f'<div style="font-weight:600;margin:.5em 0 .1em">{escape(text)}</div>')


def table(head: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    """A small table of texts, which may have several lines."""
    look = "padding:.2em .5em .2em 0;vertical-align:top;white-space:"
    cells = "".join(
        f'<th style="{look}nowrap;text-align:left;color:{SOFT};font-weight:500">'
        f"{escape(title)}</th>"
        for title in head
    )
    body = "".join(
        "<tr>"
        + "".join(f'<td style="{look}pre-line">{escape(cell)}</td>' for cell in row)
        + "</tr>"
        for row in rows
    )
    return _block(
        f'<table style="border-collapse:collapse;font-size:.94em"><tr>{cells}</tr>{body}</table>'
    )


def _node(name: str, health: NodeHealth, now_s: float) -> str:
    silent = health.silent_s(now_s)
    alarm = silent and not may_end(name)
    colour = BAD if alarm else STALE if silent else LEVELS.get(health.level, STALE)
    told = f"ended: {escape(health.message)}" if health.ended else f"silent for {silent:.0f} s"
    message = told if silent else escape(health.message)
    details = "" if silent else _details(health.values)
    return (
        f'<div style="border-left:4px solid {colour};padding:.15em 0 .15em .6em;margin:.45em 0">'
        f'<b>{escape(name)}</b> <span style="color:{BAD if alarm else SOFT}">{message}</span>'
        f'<div style="color:{SOFT};font-size:.84em">{details}</div></div>'
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
        f'<span style="color:{WARNING}">{escape(key)} {escape(value)}</span>'
        for key, value in values.items()
        if key.startswith("rejected ") and value != "0"
    ]
    return " &middot; ".join(rates + latency + rejected)


def _number(text: str, form: str) -> str:
    """A number in this format, or what came in its place."""
    try:
        return format(float(text), form)
    except ValueError:
        return escape(text)


def _chip(label: str, colours: Mapping[str, str]) -> str:
    return (
        f'<span style="background:{colours.get(label, STALE)};color:white;border-radius:9px;'
        f'padding:.08em .6em;font-weight:600;white-space:nowrap">{escape(readable(label))}</span>'
    )


def _with_code(text: str, look: str = "padding:0 .3em") -> str:
    parts = escape(text).split("`")
    style = f"background:{RULE};border-radius:3px;font-size:.92em;overflow-wrap:anywhere;{look}"
    return "".join(
        f'<code style="{style}">{part}</code>' if k % 2 else part for k, part in enumerate(parts)
    )


def _block(content: str) -> str:
    return (
        f'<div style="{FONT};color:{INK};font-size:.92em;line-height:1.4;padding:.15em .75em">'
        f"{content}</div>"
    )
