# SPDX-License-Identifier: Apache-2.0
"""What README and docs name exists: links, pictures, commands, options, parameters, reasons."""

import ast
import re
import shlex
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from intent_recognition.cli.main import make_parser
from intent_recognition.storage.dofs import DofSpec, load_dofs

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}
NODES = {
    "mocap_ingest": "intent_recognition",
    "intent_estimator": "intent_recognition",
    "primitive_activation": "intent_recognition",
    "bag_recorder": "intent_recognition",
    "bag_player": "intent_recognition",
    "lwr_sim": "sim_bridge",
    "coworker_sim": "sim_bridge",
}
COMMON_SOURCES = ("intent_recognition/nodes/lifecycle.py",)
LARGEST_PICTURE = 300_000


def blocks(text, language):
    """Contents of the fenced blocks of a language."""
    return re.findall(rf"^ *```{language}\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL)


def slug(heading):
    """The anchor a heading gets."""
    return re.sub(r"[^\w\- ]", "", heading.lower().replace("`", "")).strip().replace(" ", "-")


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {slug(heading) for heading in headings}


def shell_lines():
    """Every command line of the shell blocks, comments off, continued lines joined."""
    for name, text in TEXTS.items():
        for block in blocks(text, "bash"):
            for line in block.replace("\\\n", " ").splitlines():
                for command in line.replace(" && ", "\n").splitlines():
                    words = shlex.split(command.strip().removeprefix("# or:"), comments=True)
                    if words:
                        yield pytest.param(words, id=f"{name}: {' '.join(words)[:60]}")


def constants(*paths):
    """All texts that stand in source files as literals."""
    found = set()
    for path in paths:
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return found


def node_constants(node):
    """Texts in a node's own file and in those of its room that it imports from."""
    path = f"{NODES[node]}/nodes/{node}.py"
    imported = re.findall(
        rf"^from {NODES[node]}\.nodes\.(\w+) import", (ROOT / path).read_text("utf-8"), re.M
    )
    parts = [f"{NODES[node]}/nodes/{part}.py" for part in imported]
    return constants(path, *parts, *COMMON_SOURCES)


def table(text, heading):
    """Rows of the first table below a heading, as lists of cells."""
    part = text.split(f"## {heading}\n", 1)[1]
    rows = re.search(r"((?:^\|.*\n)+)", part, re.MULTILINE)[1].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def code(text):
    return re.findall(r"`([^`]+)`", text)


LINKS = [
    pytest.param(name, target, id=f"{name}: {target}")
    for name, text in TEXTS.items()
    for target in re.findall(r"\]\(([^)\s]+)\)", text)
    if not target.startswith("http")
]


@pytest.mark.parametrize(("name", "target"), LINKS)
def test_link_leads_somewhere(name, target):
    file, _, anchor = target.partition("#")
    page = (ROOT / name).parent / file if file else ROOT / name
    assert page.exists()
    if anchor:
        assert anchor in anchors(page)


def test_pictures_are_small_and_shown():
    pictures = sorted((ROOT / "docs" / "images").glob("*.png"))
    assert pictures
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size < LARGEST_PICTURE
        assert any(f"images/{picture.name}" in text for text in TEXTS.values())


@pytest.mark.parametrize("words", list(shell_lines()))
def test_command_exists_with_its_options(words):
    if words[0] == "intent" and words[1:] != ["--help"]:
        make_parser().parse_args(words[1:])
    elif words[0] == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        assert re.search(rf"^{words[1]}:", makefile, re.MULTILINE)
    elif words[:2] == ["ros2", "launch"]:
        text = (ROOT / "launch" / words[3]).read_text(encoding="utf-8")
        declared = re.findall(r"DeclareLaunchArgument\(\s*\"(\w+)\"", text)
        assert words[2] == "intent_recognition"
        assert {word.partition(":=")[0] for word in words[4:]} <= set(declared)
    elif words[:2] == ["ros2", "run"]:
        assert words[2] == "intent_recognition"
        check_node_command(words[3], words[4:])
    elif words[0] in NODES:
        check_node_command(words[0], words[1:])
    elif words[:3] == ["ros2", "service", "call"]:
        _, node, service = words[3].split("/")
        assert f"~/{service}" in node_constants(node)


def check_node_command(node, words):
    assert node in NODES
    pairs = list(pairwise(words))
    literals = node_constants(node)
    for option, value in pairs:
        if option in ("-p", "-r"):
            assert value.partition(":=")[0] in literals


def test_inline_commands_exist():
    for text in TEXTS.values():
        for words in (shlex.split(inline) for inline in code(text) if inline.startswith("intent ")):
            known = words[1:2] in (["--help"], ["--version"]) or words[1] in command_names()
            assert known, words
    arguments = re.search(r'DEMO_ARGS="([^"]*)"', TEXTS["README.md"])[1]
    make_parser().parse_args(["demo", *arguments.split()])


def command_names():
    action = next(a for a in make_parser()._actions if a.choices and not a.option_strings)
    return set(action.choices)


def test_changelog_names_the_commands_there_are():
    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert command_names() <= set(re.findall(r"``(?:intent )?(\w+)``", text))


def test_parameters_of_the_table_are_declared_and_complete():
    rows = table(TEXTS["docs/topics.md"], "Parameters")
    assert {code(row[0])[0] for row in rows} == set(NODES)
    for node, parameters in rows:
        assert set(code(parameters)) <= node_constants(code(node)[0]), node


def test_parameters_of_the_shipped_file_stand_in_the_table():
    rows = {code(row[0])[0]: code(row[1]) for row in table(TEXTS["docs/topics.md"], "Parameters")}
    shipped = yaml.safe_load((ROOT / "config" / "params.yaml").read_text(encoding="utf-8"))
    for name, content in shipped.items():
        node = name.rpartition("/")[2]
        assert set(content["ros__parameters"]) <= set(rows[node]), node


@pytest.mark.parametrize("name", TEXTS)
def test_parameter_files_shown_are_right(name):
    for block in blocks(TEXTS[name], "yaml"):
        for key, content in yaml.safe_load(block).items():
            if isinstance(content, dict) and "ros__parameters" in content:
                node = key.rpartition("/")[2]
                assert set(content["ros__parameters"]) <= node_constants(node)


@pytest.mark.parametrize("name", TEXTS)
def test_dof_files_shown_are_valid(name):
    for block in blocks(TEXTS[name], "yaml"):
        content = yaml.safe_load(block)
        if "observed" in content:
            assert DofSpec.from_dict(content).observed_names


def test_shipped_dof_file_is_shown_as_it_is():
    first = yaml.safe_load(blocks(TEXTS["docs/bags.md"], "yaml")[0])
    assert DofSpec.from_dict(first) == load_dofs(ROOT / "config" / "dofs.yaml")


def test_reasons_of_the_table_are_counted_somewhere():
    rooms = set(NODES.values())
    sources = [p.relative_to(ROOT) for room in rooms for p in (ROOT / room).rglob("*.py")]
    literals = constants(*sources)
    for _, reasons, _ in table(TEXTS["docs/topics.md"], "What bad input gets"):
        for reason in code(reasons):
            last = reason.removeprefix("count ").removeprefix("stopped: ")
            if last not in literals:  # put together where it is counted
                last = last.removeprefix("posture_")
            assert last in literals, reason


def test_services_of_the_table_exist():
    for services, _, _ in table(TEXTS["docs/topics.md"], "Services"):
        for name in code(services):
            node, _, service = name.partition("/")
            assert f"~/{service}" in node_constants(node), name


def test_graph_names_every_recognition_node_and_topic():
    (graph,) = blocks(TEXTS["README.md"], "mermaid")
    for node in ("mocap_ingest", "intent_estimator", "primitive_activation"):
        assert node in graph
    topics = {code(row[0])[0] for row in table(TEXTS["docs/topics.md"], "Topics")}
    for topic in re.findall(r'"(?:[^"]*?)((?:intent|joint)[\w/]*)<br/>', graph):
        assert topic in topics


def test_nothing_is_left_to_fill_in():
    assert not re.search(r"TODO|FIXME|DEMO_EXCERPT", "".join(TEXTS.values()))
