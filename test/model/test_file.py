# SPDX-License-Identifier: Apache-2.0
"""The model file: exact there and back, and a clear error for everything that is not one."""

import io
import json
import zipfile
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model_builder import GLOVE, WRIST, make_dofs, true_library
from same_library import assert_same

from intent_recognition.demonstrations.dofs import DofSpec
from intent_recognition.errors import DofError, ModelError
from intent_recognition.model.checks import COUPLING, POSE
from intent_recognition.model.file import (
    DEVIATION_STD,
    FORMAT_VERSION,
    SHAPES,
    Model,
    check_dofs,
    load_model,
    save_model,
)
from intent_recognition.promp import (
    LEADS,
    LeftOutOdds,
    PhaseDeviation,
    PoseRegression,
    ResidualCoupling,
    TaskLibrary,
)


def a_coupling(library: TaskLibrary) -> ResidualCoupling:
    parts = ResidualCoupling.none(library.n_tasks, library.n_controlled, library.n_observed)
    return ResidualCoupling(parts.gain + 0.3, parts.explained + 0.2, 0.5 * parts.decay_s)


@pytest.fixture(scope="module")
def model() -> Model:
    dofs = make_dofs(WRIST, GLOVE)
    library = true_library(dofs)
    n_controlled, n_leads = library.n_controlled, len(LEADS)
    n_state = 2 * library.n_observed + n_controlled
    sizes = (n_state,), (n_state,), (6, n_state), (), (6, n_leads, n_controlled), (n_leads,)
    library = replace(
        library,
        observed_weight_covariance=1.5 * library.observed_covariance[:-1],
        noise_scale=2.0,
        none_margin=3.5,
        switch_margin=1.25,
        stop_margin=2.75,
        phase_deviation=PhaseDeviation(np.linspace(0.0, 0.1, 7), 0.4, 0.15, False, 0.7),
        evidence_freedom=4.0,
        left_out_odds=LeftOutOdds((0.5, -1.25), ("anna", "")),
        provenance={"bags": ["a", "b"], "package_version": "1"},
        coupling=a_coupling(library),
        pose_regression=PoseRegression(*(np.full((library.n_tasks, *size), 0.1) for size in sizes)),
        usual_log_duration=np.linspace(0.1, 0.4, library.n_tasks + 1),
        displacement_exponent=2.0,
        delay_s=0.25,
    )
    return Model(library, dofs)


@pytest.fixture(scope="module")
def written(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "model.npz"
    save_model(path, model)
    return path


def content(path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def rewritten(path, written, **changes):
    """The written model with arrays replaced, or left out where the change is None."""
    arrays = {k: v for k, v in (content(written) | changes).items() if v is not None}
    np.savez(path, **arrays)
    return path


def with_header(path, written, change):
    header = json.loads(str(content(written)["header"]))
    change(header)
    return rewritten(path, written, header=np.array(json.dumps(header)))


def refused(path, *words):
    with pytest.raises(ModelError) as caught:
        load_model(path)
    text = str(caught.value)
    for word in (str(path), *words):
        assert word in text, text
    return text


def test_what_was_written_is_read_bit_for_bit(model, written):
    read = load_model(written)
    assert read.dofs == model.dofs
    assert read.labels == model.labels and read.controlled_names == model.controlled_names
    assert_same(read.library, model.library, rtol=0.0, apart=())
    assert read.library.n_demonstrations.dtype == model.library.n_demonstrations.dtype


def test_a_model_may_be_without_a_coupling(written, tmp_path):
    without = rewritten(tmp_path / "m.npz", written, **dict.fromkeys((*COUPLING, *POSE)))
    library = load_model(without).library
    assert library.coupling is library.pose_regression is None


def test_a_folder_is_made_and_nothing_is_left_beside(model, tmp_path):
    save_model(tmp_path / "new" / "deep" / "m.npz", model)
    save_model(tmp_path / "new" / "deep" / "m.npz", model)
    assert [p.name for p in (tmp_path / "new" / "deep").iterdir()] == ["m.npz"]


def test_an_output_that_cannot_be_written_is_named(model, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelError, match="file"):
        save_model(tmp_path / "file" / "m.npz", model)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(ModelError, match=r"folder\.npz"):
        save_model(tmp_path / "folder.npz", model)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder.npz"]


def test_what_is_no_model_is_refused(written, tmp_path):
    refused(tmp_path / "missing.npz")
    refused(tmp_path)
    for name, data in (("empty", b""), ("text", b"hello"), ("zip", b"PK\x03\x04 no zip")):
        path = tmp_path / f"{name}.npz"
        path.write_bytes(data)
        refused(path)
    array = tmp_path / "array.npz"
    with array.open("wb") as file:
        np.save(file, np.zeros(3))
    refused(array)
    other = tmp_path / "other.npz"
    np.savez(other, weights=np.zeros(3))
    refused(other, "header")
    archive = tmp_path / "archive.npz"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("notes.txt", "no arrays")
    refused(archive)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.99])
def test_a_truncated_file_is_refused(written, tmp_path, share):
    data = written.read_bytes()
    path = tmp_path / "cut.npz"
    path.write_bytes(data[: int(share * len(data))])
    refused(path)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_flipped_bits_are_an_error_or_harmless(model, written, tmp_path, data):
    raw = bytearray(written.read_bytes())
    at = data.draw(st.integers(0, len(raw) - 1))
    raw[at] ^= 1 << data.draw(st.integers(0, 7))
    path = tmp_path / "flipped.npz"
    path.write_bytes(raw)
    try:
        read = load_model(path)
    except ModelError as error:
        assert str(path) in str(error)
    else:
        np.testing.assert_array_equal(read.library.weight_mean, model.library.weight_mean)


@pytest.mark.parametrize("name", sorted({*SHAPES, "header"}))
def test_a_missing_array_is_named(written, tmp_path, name):
    refused(rewritten(tmp_path / "m.npz", written, **{name: None}), name)


FAULTS = {
    "longer": lambda right: np.stack([right, right]),
    "flat": lambda right: np.zeros((1, 1, 1, 1)),
    "words": lambda right: np.full(right.shape, "word"),
    "complex": lambda right: right + 1j,
}


@pytest.mark.parametrize(
    ("name", "fault"),
    [(name, fault) for k, name in enumerate(SHAPES) for fault in (*FAULTS,)[k % 2 :: 2]],
)
def test_a_wrong_shape_or_kind_is_named(written, tmp_path, name, fault):
    wrong = FAULTS[fault](content(written)[name])
    refused(rewritten(tmp_path / "m.npz", written, **{name: wrong}), name)


@pytest.mark.parametrize("name", [n for n in SHAPES if n not in ("observed_groups",)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_named(written, tmp_path, name, value):
    wrong = content(written)[name].astype(np.float64)
    wrong.reshape(-1)[-1] = value
    refused(rewritten(tmp_path / "m.npz", written, **{name: wrong}), name)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("noise_variance", np.zeros_like),
        ("noise_scale", lambda a: a - 3.0),
        ("correlation_time_s", np.zeros_like),
        ("log_duration_std", np.zeros_like),
        ("none_prior", np.ones_like),
        ("task_prior", lambda a: 0.9 + 0.0 * a),
        ("observed_groups", lambda a: np.array([4, 2])),  # they do not add up
        ("coupling_gain", lambda a: a[:, :1]),
        ("coupling_gain", lambda a: a * np.nan),
        ("coupling_explained", lambda a: a + 0.8),
        ("coupling_decay_s", lambda a: 0.0 * a),
        ("usual_log_duration", lambda a: a[1:]),
        ("usual_log_duration", lambda a: a + 30.0),
        ("displacement_exponent", lambda a: a + 30.0),
        ("delay_s", lambda a: a + 1e7),
        ("coupling_decay_s", lambda a: None),
        ("pose_coefficients", lambda a: a[:, :-1]),
        ("pose_states", lambda a: a[0, 0, 0]),
        ("pose_scale", lambda a: 0.0 * a),
        ("pose_share", lambda a: a + 1.0),
        ("pose_length", lambda a: None),
        (DEVIATION_STD, lambda a: None),
        (DEVIATION_STD, lambda a: a[:1]),
        (DEVIATION_STD, lambda a: np.zeros((2, 2))),
        (DEVIATION_STD, lambda a: np.array([0.0, -0.1])),
        (DEVIATION_STD, lambda a: np.array([0.0, np.nan])),
    ],
)
def test_values_that_make_no_sense_are_named(written, tmp_path, name, change):
    bad = rewritten(tmp_path / "m.npz", written, **{name: change(content(written)[name])})
    refused(bad, "phase_deviation" if name == DEVIATION_STD else name)


def test_a_pickled_object_is_refused_unread(written, tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("the pickle was executed",))

    buffer = io.BytesIO()
    np.save(buffer, np.array([Trap()], dtype=object), allow_pickle=True)
    path = tmp_path / "m.npz"
    with zipfile.ZipFile(written) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            trapped = name == "weight_mean.npy"
            target.writestr(name, buffer.getvalue() if trapped else source.read(name))
    refused(path, "weight_mean")


@pytest.mark.parametrize("version", [FORMAT_VERSION + 1, 2, 1, 0, "1", None])
def test_another_version_is_refused_before_anything_else(written, tmp_path, version):
    def change(header):
        header.clear()
        header["format_version"] = version

    path = with_header(tmp_path / "m.npz", written, change)
    refused(path, "format_version", str(version), "train again")


@pytest.mark.parametrize(
    "key", ["format_version", "labels", "basis", "onset", "dofs", "provenance", "phase_deviation"]
)
def test_a_header_without_a_key_is_refused(written, tmp_path, key):
    refused(with_header(tmp_path / "m.npz", written, lambda header: header.pop(key)), key)


HUGE = 10**400
BAD = {
    "labels": (["a", "a", "b"], ["a", "b", "none"], 3),
    "basis": ({"n_basis": 0, "width": 1.0}, {"n": 3}),
    "onset": ([{"reference_speed": -1.0}], []),
    "dofs": ({"observed": []}, []),
    "provenance": ("words",),
    "left_out_odds.odds": ([1.0, "x"], [1.0, 1e400], [1.0], [1.0, 2.0, 3.0], 4.0),
    "evidence_freedom": (0, -1.0, "4", [], True, HUGE),
    "phase_deviation.correlation": (0.0, -1, "long", HUGE),
    "phase_deviation.evidence": (0.0, 1.5, None),
    "phase_deviation.controlled_follows": ("no", None),
    "phase_deviation.duration_exponent": (11.0, None, "long"),
}


@pytest.mark.parametrize(
    ("key", "value"), [(key, v) for key, values in BAD.items() for v in values]
)
def test_a_header_with_a_bad_value_is_refused(written, tmp_path, key, value):
    name, _, inner = key.partition(".")

    def change(header):
        part = header[name] if inner else header
        part[inner or name] = value

    text = refused(with_header(tmp_path / "m.npz", written, change))
    if inner or name == "evidence_freedom":
        assert name in text and "\n" not in text


@pytest.mark.parametrize("freedom", [inf, 4.0, 1])
def test_the_freedom_of_the_evidence_may_be_infinite(model, tmp_path, freedom):
    """A normal density; JSON knows no infinity, so that the file says null."""
    path = tmp_path / "m.npz"
    save_model(path, replace(model, library=replace(model.library, evidence_freedom=freedom)))
    assert load_model(path).library.evidence_freedom == freedom
    header = json.loads(str(content(path)["header"]))
    assert header["evidence_freedom"] == (None if freedom == inf else freedom)


@pytest.mark.parametrize("text", ["", "[]", "3", "{", "null"])
def test_a_header_that_is_no_mapping_is_refused(written, tmp_path, text):
    refused(rewritten(tmp_path / "m.npz", written, header=np.array(text)), "header")


def test_dofs_that_differ_are_named_on_both_sides(model):
    check_dofs(model, model.dofs, "mine.yaml")
    fewer = make_dofs(WRIST)
    with pytest.raises(DofError) as caught:
        check_dofs(model, fewer, "mine.yaml")
    text = str(caught.value)
    assert "mine.yaml: observed" in text and GLOVE.joints[0] in text
    assert text.count(WRIST.topic) == 2  # what the model has, and what the file has
    other = replace(model.dofs.controlled[0], joints=tuple("abcdefg"))
    with pytest.raises(DofError, match=r"mine.yaml: controlled.*lwr_a1_joint.*\"a\", \"b\""):
        check_dofs(model, DofSpec(model.dofs.observed, (other,)), "mine.yaml")
