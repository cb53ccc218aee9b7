# SPDX-License-Identifier: Apache-2.0
"""Files of objects: annotated ones, and the meshes and clouds they are warped onto."""

from intent_recognition.objects.file import FOLDER, find_object, load_object, save_object
from intent_recognition.objects.targets import load_target
