# SPDX-License-Identifier: Apache-2.0
"""What README and docs name exists: links, pictures, parameters, reasons; commands: test/docs."""

import ast
import re
from pathlib import Path

import pytest
import yaml
from docs.shown import nodes
from rclpy.qos import QoSDurabilityPolicy

from intent_recognition.bags import TopicInfo
from intent_recognition.demonstrations.dofs import DofSpec, load_dofs
from intent_recognition.nodes.qos import recorded_profile
from intent_recognition.tables.import_map import ImportMap

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}
NODES = nodes()
ROOMS = ("intent_recognition", "sim_bridge")
LINK = re.compile(r"\]\((?!http)([^)\s]+)\)")


def blocks(text, language):
    """Contents of the fenced blocks of a language."""
    return re.findall(rf"^ *```{language}\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL)


def slug(heading):
    """The anchor a heading gets."""
    return re.sub(r"[^\w\- ]", "", heading.lower().replace("`", "")).strip().replace(" ", "-")


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {slug(heading) for heading in headings}


def constants(*paths):
    """All texts that stand in source files as literals."""
    found = set()
    for path in paths:
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return found


def table(text, heading):
    """Rows of the first table below a heading, as lists of cells."""
    part = text.split(f"## {heading}\n", 1)[1]
    rows = re.search(r"((?:^\|.*\n)+)", part, re.MULTILINE)[1].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def code(text):
    return re.findall(r"`([^`]+)`", text)


def leads_somewhere(name, target):
    file, _, anchor = target.partition("#")
    page = (ROOT / name).parent / file if file else ROOT / name
    return page.exists() and (not anchor or anchor in anchors(page))


def test_every_link_leads_somewhere():
    links = [(n, link) for n, text in TEXTS.items() for link in LINK.findall(text)]
    assert links
    assert [link for link in links if not leads_somewhere(*link)] == []


def yaml_shown():
    """Pages and what their YAML blocks say; a list is a part of a file."""
    for name, text in TEXTS.items():
        for block in blocks(text, "yaml"):
            if isinstance(shown := yaml.safe_load(block), dict):
                yield name, shown


def test_parameter_files_shown_are_right():
    for name, shown in yaml_shown():
        for key, content in shown.items():
            if isinstance(content, dict) and "ros__parameters" in content:
                node = key.rpartition("/")[2]
                assert set(content["ros__parameters"]) <= NODES[node].parameters, name


def test_dof_files_and_maps_shown_are_valid():
    for name, shown in yaml_shown():
        if "observed" in shown:
            is_map = name == "docs/import.md" or "columns" in shown["observed"][0]
            what = ImportMap if is_map else DofSpec
            assert what.from_dict(shown), name


def test_shipped_dof_file_is_shown_as_it_is():
    first = yaml.safe_load(blocks(TEXTS["docs/bags.md"], "yaml")[0])
    assert DofSpec.from_dict(first) == load_dofs(ROOT / "config" / "dofs.yaml")


@pytest.mark.slow
def test_reasons_of_the_table_are_counted_somewhere():
    sources = [p.relative_to(ROOT) for room in ROOMS for p in (ROOT / room).rglob("*.py")]
    literals = constants(*sources)
    for _, reasons, _ in table(TEXTS["docs/topics.md"], "What bad input gets"):
        for reason in code(reasons):
            last = reason.removeprefix("count ").removeprefix("stopped: ").removeprefix("<topic>")
            if last not in literals:  # put together where it is counted
                last = last.removeprefix("posture_")
            assert last in literals, reason


def test_topics_are_played_as_the_table_says():
    for topics, *_, profile in table(TEXTS["docs/topics.md"], "Topics"):
        for name in code(topics):
            recorded = recorded_profile(TopicInfo(f"/{name}", "any"))
            latched = recorded.durability is QoSDurabilityPolicy.TRANSIENT_LOCAL
            assert latched == ("latched" in profile), name


def test_services_of_the_table_exist():
    for services, _, _ in table(TEXTS["docs/topics.md"], "Services"):
        for name in code(services):
            node, _, service = name.partition("/")
            assert f"~/{service}" in NODES[node].services, name


def test_the_way_of_a_pose_leads_through_functions_there_are():
    way = table((ROOT / "CONTRIBUTING.md").read_text(), "The way of a pose")
    for file, functions, _ in way:
        source = (ROOT / "intent_recognition" / code(file)[0]).read_text()
        assert all(f"def {name}(" in source for name in code(functions)), file
