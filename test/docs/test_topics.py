# SPDX-License-Identifier: Apache-2.0
"""The page of topics has what nodes publish and why they reject input."""

import re

from docs.shown import ROOT

from intent_recognition.registry import NODES

TOPICS = (ROOT / "docs" / "topics.md").read_text(encoding="utf-8").replace("<body>", "{body}")
REASON = re.compile(r"""(?:reject|RejectionError)\(\s*"(\w+)\"""")


def test_every_topic_of_a_node_is_listed():
    published = {topic for node in NODES.values() for topic in node.publishes}
    other = {"/tf", "/tf_static", "mocap/wrist/pose", "{sampled}"}  # under another heading or name
    assert other <= published
    assert not [topic for topic in sorted(published - other) if f"`{topic}`" not in TOPICS]


def test_every_reason_to_reject_is_named():
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    sources = [
        path.read_text(encoding="utf-8")
        for folder in ("intent_recognition", "sim_bridge")
        for path in (ROOT / folder).rglob("*.py")
    ]
    reasons = {reason for source in sources for reason in REASON.findall(source)}
    assert len(reasons) > 50
    assert not [reason for reason in sorted(reasons) if f"`{reason}`" not in pages]
