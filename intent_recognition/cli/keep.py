# SPDX-License-Identifier: Apache-2.0
"""Learn from the last execution in which a person guided the arm: from now on the robot moves as
corrected, and other tasks stay as they are. A running task_teacher must have recorded it
(docs/correcting.md). `intent undo` takes it back. Needs ROS 2.

# keep the last correction
intent keep --library tasks
"""

from intent_recognition.cli.teach import add_library_options
from intent_recognition.cli.undo import run  # noqa: F401  runs this command, too

MORE = (add_library_options,)
