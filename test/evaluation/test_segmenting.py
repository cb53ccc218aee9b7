# SPDX-License-Identifier: Apache-2.0
"""Sessions into demonstrations: the shipped ones are cut where their markers say."""

import numpy as np
import pytest

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import find_bags, load_dofs, read_demonstrations
from intent_recognition.errors import BagError, ResourceBusyError
from intent_recognition.evaluation import propose_segments
from intent_recognition.evaluation.segmenting import (
    Segment,
    label_spans,
    recognise_segments,
    write_segments,
)
from intent_recognition.model import load_model
from intent_recognition.promp import NONE
from intent_recognition.recognition import Estimate
from intent_recognition.signals import Span
from sim_bridge.scenarios.assembly.session import MARGIN_S

CLOSE_S, SHARE = 0.2, 0.9
LABELS = ("plate", "screw", NONE)


def truth(bag, margin_s=0.0):
    """Boundaries (n, 2) [ns] and labels of a session's markers, the margins taken away."""
    markers = [(m.log_time_ns, m.message.data) for m in BagReader(bag).messages(["demonstration"])]
    at = np.array([ns for ns, _ in markers]).reshape(-1, 2)
    return at + np.array([1, -1]) * round(margin_s * 1e9), [label for _, label in markers[::2]]


def distances_s(segments, wanted):
    """Distance of each true boundary from that of the segment in the same place, (n, 2)."""
    return np.abs(np.array([segment[:2] for segment in segments]) - wanted) * 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "dofs", "margin_s"),
    [("sessions", "dofs.yaml", 0.0), ("assembly", "dofs_two_humans.yaml", MARGIN_S)],
)
def test_the_shipped_sessions_are_cut_where_they_were_marked(repository, folder, dofs, margin_s):
    """Every interaction is found, and no other; 90 % of the boundaries are within 0.2 s."""
    found = []
    for bag in find_bags(repository / "bags" / folder):
        wanted, _ = truth(bag, margin_s)
        segments = propose_segments(bag, load_dofs(repository / "config" / dofs))
        assert len(segments) == len(wanted)
        found.append(distances_s(segments, wanted))
    assert np.mean(np.concatenate(found) <= CLOSE_S) >= SHARE


@pytest.mark.slow
def test_a_model_labels_the_interactions_of_a_session(repository, toolbox_model, tmp_path):
    model = load_model(toolbox_model)
    bag = repository / "bags/sessions/session_00"
    segments = recognise_segments(bag, model)
    wanted, labels = truth(bag)
    assert [segment.task for segment in segments] == labels
    assert np.mean(distances_s(segments, wanted) <= CLOSE_S) >= SHARE
    paths = write_segments(bag, model.dofs, segments, tmp_path / "out")
    observed_alone = load_dofs(repository / "config/dofs.yaml")
    observed_alone = type(observed_alone)(observed_alone.observed, ())
    demonstrations, rejections = read_demonstrations(tmp_path / "out", observed_alone)
    assert not rejections and [d.task for d in demonstrations] == labels
    for one, segment, path in zip(demonstrations, segments, paths, strict=True):
        assert segment.start_ns <= one.start_ns < one.end_ns <= segment.end_ns
        assert one.end_ns - one.start_ns > 0.9 * (segment.end_ns - segment.start_ns)
        assert path.name == f"session_00_{paths.index(path):03d}"
        whole = read_whole_messages(bag, segment)
        assert [m.data for m in BagReader(path).raw_messages()] == whole


def read_whole_messages(bag, segment):
    return [
        message.data
        for message in BagReader(bag).raw_messages()
        if message.topic == "/mocap/wrist/pose"
        and segment.start_ns <= message.log_time_ns <= segment.end_ns
    ]


def estimate(stamp_ns, onset_ns, task):
    p = np.array([float(label == task) for label in LABELS])
    return Estimate(stamp_ns, onset_ns > 0, onset_ns, p, p, p, None, LABELS)


def test_a_span_is_divided_where_the_estimator_saw_another_movement_begin():
    s = 1_000_000_000
    seen = [
        estimate(1 * s, 0, NONE),
        estimate(3 * s, 2 * s, "screw"),
        estimate(4 * s, 2 * s, "plate"),  # what it is taken for when it ends
        estimate(6 * s, 5 * s, NONE),  # the way back
        estimate(9 * s, 8 * s, "screw"),
        estimate(10 * s, 8 * s, "screw"),
        estimate(11 * s, 0, NONE),
    ]
    found = label_spans([Span(2 * s, 10 * s)], seen)
    assert found == [Segment(2 * s, 5 * s, "plate"), Segment(8 * s, 10 * s, "screw")]
    assert label_spans([Span(2 * s, 4 * s), Span(8 * s + s // 10, 10 * s)], seen) == [
        Segment(2 * s, 4 * s, "plate"),
        Segment(8 * s + s // 10, 10 * s, "screw"),
    ]
    assert label_spans([Span(12 * s, 13 * s)], seen) == []


def test_no_bag_is_replaced_and_what_is_no_session_is_named(repository, tmp_path):
    bag, dofs = repository / "bags/sessions/session_00", load_dofs()
    first = truth(bag)[0][0]
    segments = [Segment(*first.tolist(), None)]
    write_segments(bag, dofs, segments, tmp_path)
    with pytest.raises(ResourceBusyError, match="no bag of that name"):
        write_segments(bag, dofs, segments, tmp_path)
    with pytest.raises(BagError, match="one bag"):
        propose_segments(repository / "bags/sessions", dofs)
