# SPDX-License-Identifier: Apache-2.0
"""The commands that README and docs show, and what the reference says about nodes."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = (
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "bags/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
)
CONTINUED = re.compile(r"\\\n *#?")
BLOCK = re.compile(r"^ *```(?:bash|sh|shell|console)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Shown:
    """One command of a page."""

    page: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}: {' '.join(self.words)[:70]}"


def commands() -> list[Shown]:
    """Every command of every shell block: without comments and last &, lines joined, && apart."""
    found = []
    for page in PAGES:
        for block in BLOCK.findall(page.read_text(encoding="utf-8")):
            for line in CONTINUED.sub(" ", block).splitlines():
                found += _commands_of(str(page.relative_to(ROOT)), line)
    return found


def launched(file: str) -> tuple[str, frozenset[str]]:
    """The graph that a launch file starts, and the arguments that the file itself declares."""
    text = (ROOT / "launch" / file).read_text(encoding="utf-8")
    included = re.search(r"launch/(\w+)\.launch\.py", text)
    own = re.findall(r'DeclareLaunchArgument\("(\w+)"', text)
    return included[1] if included else file.removesuffix(".launch.py"), frozenset(own)


def inline_commands() -> list[Shown]:
    """Every `intent ...` and `make ...` in the text."""
    found = []
    for page in PAGES:
        text = BLOCK.sub("", page.read_text(encoding="utf-8"))
        for inline in re.findall(r"`((?:intent|make) [^`\n]+)`", text):
            found.append(Shown(str(page.relative_to(ROOT)), tuple(shlex.split(inline))))
    return found


def _commands_of(page: str, line: str) -> list[Shown]:
    parts = line.strip().removeprefix("# or:").removesuffix(" &").split(" && ")
    split = [shlex.split(part, comments=True) for part in parts]
    return [Shown(page, tuple(words)) for words in split if words]


@dataclass(frozen=True)
class NodeReference:
    """What docs/reference/nodes.md says about a node."""

    parameters: frozenset[str]
    topics: frozenset[str]
    services: frozenset[str]


def nodes() -> dict[str, NodeReference]:
    """All nodes of the reference, which a test compares with the nodes themselves."""
    text = (ROOT / "docs" / "reference" / "nodes.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    sections["lwr_sim"] = sections["arm_sim"]  # the page says so
    return {name: _node(section) for name, section in sections.items()}


def _node(section: str) -> NodeReference:
    def listed(word: str) -> frozenset[str]:
        lists = re.findall(rf"\b{word}: ((?:`[^`]+`(?: \([^)]+\))?(?:, )?)+)\.", section)
        return frozenset(name for found in lists for name in re.findall("`([^`]+)`", found))

    return NodeReference(
        frozenset(re.findall(r"^\|`(\w+)`(?:\\\*)?\|", section, re.MULTILINE)) | listed("As above"),
        listed("In") | listed("Out"),
        listed("Offers"),
    )
