# SPDX-License-Identifier: Apache-2.0
"""The file of an annotated object."""

import numpy as np
import pytest

from intent_recognition.errors import ModelError
from intent_recognition.objects.file import find_object, load_object, save_object


def test_what_is_written_is_read(tmp_path):
    """Positions to 32 bits, labels exactly."""
    mug = load_object(find_object("mug"))
    again = load_object(save_object(tmp_path / "new" / "cup.npz", mug))
    np.testing.assert_allclose(again.points, mug.points, atol=1e-7)
    np.testing.assert_allclose(again.normals, mug.normals, atol=1e-6)
    np.testing.assert_array_equal(again.labels, mug.labels)


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
        "short": arrays | {"labels": arrays["labels"][:-1]},
    }
    for name, content in files.items():
        np.savez(tmp_path / f"{name}.npz", **content)
    for name in ("broken", *files, "absent"):
        with pytest.raises(ModelError, match=name):
            load_object(tmp_path / f"{name}.npz")
