# SPDX-License-Identifier: Apache-2.0
"""The annotated mug."""

import pytest

from intent_recognition.objects.file import find_object, load_object
from intent_recognition.warping.object_warp import ObjectModel


@pytest.fixture(scope="session")
def mug() -> ObjectModel:
    """The shipped mug, learned from."""
    return ObjectModel.learn(load_object(find_object("mug")))
