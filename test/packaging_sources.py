# SPDX-License-Identifier: Apache-2.0
"""What an install of the package needs, copied."""

import shutil
from pathlib import Path

INSTALLED = ("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "resource")


def copy_sources(repository: Path, folder: Path, *more: str) -> None:
    """Copy the code, what describes it and `more` into a new folder; nothing that was compiled.

    What is compiled there is not optimised, which takes a tenth of the time.
    """
    folder.mkdir(parents=True)
    skip = shutil.ignore_patterns("__pycache__", "*.egg-info", "*.so")
    for name in ("intent_recognition", "sim_bridge", *INSTALLED, *more):
        if (repository / name).is_dir():
            shutil.copytree(repository / name, folder / name, ignore=skip)
        else:
            shutil.copy(repository / name, folder / name)
    setup = (folder / "setup.py").read_text(encoding="utf-8")
    (folder / "setup.py").write_text(setup.replace('"-O3"', '"-O0"'), encoding="utf-8")
