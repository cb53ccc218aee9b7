# SPDX-License-Identifier: Apache-2.0
"""The annotated mug."""

import pytest

from intent_recognition.objects.file import find_object, load_object
from intent_recognition.warping.object_warp import WarpSource, prepare_source


@pytest.fixture(scope="session")
def mug() -> WarpSource:
    """The shipped mug, learned from."""
    return prepare_source(load_object(find_object("mug")))
