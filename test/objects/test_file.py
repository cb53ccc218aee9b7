# SPDX-License-Identifier: Apache-2.0
"""The file of an annotated object."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.objects.file import find_object, load_object, save_object
from intent_recognition.warping import ObjectCloud, ObjectModel, warp_grasp, warp_object


def test_what_is_written_is_read(tmp_path):
    """Positions to 32 bits, labels exactly."""
    mug = load_object(find_object("mug"))
    again = load_object(save_object(tmp_path / "new" / "cup.npz", mug))
    np.testing.assert_allclose(again.points, mug.points, atol=1e-7)
    np.testing.assert_allclose(again.normals, mug.normals, atol=1e-6)
    np.testing.assert_array_equal(again.labels, mug.labels)
    np.testing.assert_array_equal(again.grasp.pose, mug.grasp.pose)
    assert again.grasp.width_m == mug.grasp.width_m


def test_a_file_of_the_first_version_has_no_grasp(tmp_path):
    """It is read, and says so where a grasp is asked for."""
    arrays = dict(np.load(find_object("mug")))
    old = {k: v for k, v in arrays.items() if "grasp" not in k} | {"format_version": np.array(1)}
    np.savez(tmp_path / "old.npz", **old)
    source = ObjectModel.learn(load_object(tmp_path / "old.npz"))
    assert source.annotated.grasp is None
    cloud = ObjectCloud(source.annotated.points, source.annotated.normals)
    with pytest.raises(ArgumentError, match="an annotated one"):
        warp_grasp(source, warp_object(source, cloud))


def test_bad_files_are_named(tmp_path):
    """No file, no archive, another version, missing or bad arrays."""
    with pytest.raises(ModelError, match="one of mug"):
        find_object("bucket")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"nothing")
    arrays = dict(np.load(find_object("mug")))
    files = {
        "future": arrays | {"format_version": np.array(9)},
        "missing": {k: v for k, v in arrays.items() if k != "labels"},
        "nan": arrays | {"points": np.full_like(arrays["points"], np.nan)},
        "skewed": arrays | {"grasp": 2.0 * np.eye(4)},
        "widthless": {k: v for k, v in arrays.items() if k != "grasp_width_m"},
        "short": arrays | {"labels": arrays["labels"][:-1]},
    }
    for name, content in files.items():
        np.savez(tmp_path / f"{name}.npz", **content)
    for name in ("broken", *files, "absent"):
        with pytest.raises(ModelError, match=name):
            load_object(tmp_path / f"{name}.npz")
