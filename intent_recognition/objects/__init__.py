# SPDX-License-Identifier: Apache-2.0
"""Files of annotated objects, and of the meshes and clouds onto which they are warped."""

from intent_recognition.objects.file import FOLDER, find_object, load_object, save_object
from intent_recognition.objects.targets import load_target
