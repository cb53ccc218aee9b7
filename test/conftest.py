# SPDX-License-Identifier: Apache-2.0
"""The environment every test runs in, set before anything imports rclpy or numpy."""

import atexit
import faulthandler
import fcntl
import gc
import importlib.util
import os
import pkgutil
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    import numpy as np
    from xdist.workermanage import WorkerController

ROOT = Path(__file__).resolve().parents[1]
DOMAINS = range(60, 102)
STDERR = pytest.StashKey[int]()
TEST_S = 450.0
"""How long one test may take [s], on a busy machine, too."""
LOGS = tempfile.mkdtemp(prefix="intent_recognition_test_log_")
atexit.register(shutil.rmtree, LOGS, ignore_errors=True)


def reserve_domain() -> int:
    """A ROS domain that no other test process of this machine has until this one ends."""
    for domain in DOMAINS:
        path = Path(tempfile.gettempdir(), f"intent_recognition_test_domain_{domain}")
        lock = os.open(path, os.O_CREAT | os.O_RDWR)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
        else:
            return domain
    raise RuntimeError(f"tests run in all of {DOMAINS}: end some of them")


os.environ.update(
    ROS_DOMAIN_ID=str(reserve_domain()),
    ROS_AUTOMATIC_DISCOVERY_RANGE="SYSTEM_DEFAULT",  # the profile keeps to this machine
    FASTRTPS_DEFAULT_PROFILES_FILE=str(ROOT / "config" / "fastdds_localhost.xml"),
    ROS_PYTHON_CHECK_FIELDS="1",
    ROS_LOG_DIR=LOGS,
    MPLBACKEND="Agg",
)
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in nodes: small matrices, shared cores
for path in (str(ROOT), str(ROOT / "test")):
    if path not in sys.path:
        sys.path.insert(0, path)


class SkipWithoutPybullet:
    """Skips what imports pybullet where it is not installed: CPython 3.12 has no wheel of it."""

    def find_spec(self, name: str, *_: object) -> None:
        """Skip the test, or the module of tests, at hand."""
        if name.partition("_")[0] == "pybullet":
            pytest.skip(f"{name} is not installed", allow_module_level=True)


if importlib.util.find_spec("pybullet") is None:
    sys.meta_path.insert(0, SkipWithoutPybullet())

# A busy machine is no failure, and what CI refuses is the change's: it draws the same every time.
settings.register_profile("untimed", deadline=None, max_examples=50, derandomize="CI" in os.environ)
settings.load_profile("untimed")


BOUNDS = {
    "intent_recognition.learning.selection:NOISE_SCALES": (4.0,),
    "intent_recognition.learning.left_out:MAX_FOLLOWED": 2,
    "intent_recognition.learning.unknown_task:MAX_VALIDATED": 12,
    "intent_recognition.learning.held_out_examples:MAX_VALIDATED": 12,
}
"""In tests so few hyperparameters are tried and so few demonstrations left out while learning."""


def pytest_configure(config: pytest.Config) -> None:
    """Keep the standard error of this process, before a test's is captured."""
    config.stash[STDERR] = os.dup(2)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[bool | None]:
    """End the process of a test that never ends, even if it keeps the interpreter's lock.

    The traceback goes to stderr, and `pytest -n` names the test and goes on in another process.
    """
    faulthandler.dump_traceback_later(TEST_S, exit=True, file=item.config.stash[STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: "WorkerController", error: object) -> None:
    """End what a dead worker's test had started: nodes would keep cores busy until the end."""
    if error is None:
        return
    import psutil

    names = ("PYTEST_XDIST_TESTRUNUID", "PYTEST_XDIST_WORKER")
    of_worker = dict(zip(names, (node.workerinput["testrunuid"], node.gateway.id), strict=True))
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if of_worker.items() <= process.environ().items():
                process.kill()


def pytest_enter_pdb() -> None:
    """Who looks at a test with a debugger takes the time that it needs."""
    faulthandler.cancel_dump_traceback_later()


pytest_exception_interact = pytest_enter_pdb


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Modules and tests stay: the garbage collector need not pass over them again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest, so that no process has it left when the others end."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


@pytest.fixture(autouse=True, scope="session")
def usual() -> Iterator[dict[str, object]]:
    """What `BOUNDS` are outside of tests, where aligned primitives are finer, too."""
    from few_functions import aligned_basis

    found = {name: pkgutil.resolve_name(name) for name in BOUNDS}
    with bounded(BOUNDS), aligned_basis():
        yield found


@contextmanager
def bounded(numbers: dict[str, object]) -> Iterator[None]:
    """Learn with these bounds."""
    with pytest.MonkeyPatch.context() as patch:
        for name, number in numbers.items():
            patch.setattr(name.replace(":", "."), number)
        yield


@pytest.fixture(scope="class")  # of a function alone, also where Hypothesis draws many examples
def usually_left_out(usual) -> Iterator[None]:
    """Learn as outside of tests."""
    with bounded(usual):
        yield


@pytest.fixture(scope="module")
def usually_calibrated(usual) -> Iterator[None]:
    """Calibrate the margin of none as outside of tests, from here to the end of the file."""
    (name,) = (name for name in usual if name.endswith("unknown_task:MAX_VALIDATED"))
    with bounded({name: usual[name]}):
        yield


@pytest.fixture
def usually_tried(usual) -> Iterator[None]:
    """Try all noise scales, and as many basis functions as outside of tests."""
    from few_functions import USUAL, aligned_basis

    (name,) = (name for name in usual if name.endswith(":NOISE_SCALES"))
    with bounded({name: usual[name]}), aligned_basis(USUAL):
        yield


@pytest.fixture(scope="module")
def laid_out_roughly() -> Iterator[None]:
    """Figures are drawn without measuring their texts first, which takes half of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("intent_recognition.report.drawing.LAYOUT", None)
        yield


@pytest.fixture
def rng() -> "np.random.Generator":
    """A generator of its own for each test."""
    import numpy as np

    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real recordings, which are not part of the repository."""
    folder = Path(os.environ.get("INTENT_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the real recordings are not at {folder} (set INTENT_SHARED_DATA)")
    return folder


@pytest.fixture(scope="session")
def once(tmp_path_factory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Function that lets a folder of a name be filled once for all processes of a run."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def provide(name: str, fill: Callable[[Path], object]) -> Path:
        folder, filled = shared / name, shared / f"{name}.filled"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not filled.is_file():
                shutil.rmtree(folder, ignore_errors=True)  # of a test that was ended meanwhile
                folder.mkdir()
                fill(folder)
                filled.touch()
        return folder

    return provide


@pytest.fixture(scope="session")
def toolbox_model(repository, once) -> Path:
    """A model file learned from the shipped training bags, with the noise scale chosen of all."""

    def learn(folder: Path) -> None:
        with bounded({"intent_recognition.learning.selection:NOISE_SCALES": (1.0,)}):
            _learn_toolbox(repository, folder / "toolbox.npz")

    return once("toolbox", learn) / "toolbox.npz"


@pytest.fixture(scope="session")
def pouring_skill(once) -> Path:
    """A file of the skill learned from the shipped pours."""

    def learn(folder: Path) -> None:
        from intent_recognition.model import save_pouring_skill
        from intent_recognition.share import share_path
        from sim_bridge.scenarios.pouring import learn_pouring_skill

        learned = learn_pouring_skill(share_path("bags/pouring/train"), 1)
        save_pouring_skill(folder / "pouring.npz", learned)

    return once("pouring", learn) / "pouring.npz"


def _learn_toolbox(repository: Path, path: Path) -> None:
    from few_functions import USUAL, aligned_basis

    from intent_recognition.demonstrations import load_dofs, read_demonstrations
    from intent_recognition.learning import learn_with_report
    from intent_recognition.model import Model, save_model

    dofs = load_dofs(repository / "config" / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(repository / "bags/toolbox/train", dofs)
    assert not rejections and len(demonstrations) == 48
    with aligned_basis(USUAL):
        report = learn_with_report(demonstrations)
    save_model(path, Model(report.library, dofs), report.trained)


@pytest.fixture
def harness():
    """A running rclpy with one executor; see ros_harness.Harness."""
    from ros_harness import Harness

    with Harness() as running:
        yield running


@pytest.fixture(scope="session")
def ros_interfaces(once):
    """Function that lets this and other processes import a package of `test/interfaces`.

    An installed one is used as it is. Each has a folder of its own: who asks for one does not find
    another one half made.
    """

    def provide(package: str) -> None:
        if shutil.which("g++") is None:
            pytest.skip(f"no compiler for {package}")
        from ros_interfaces import build

        folder = once(f"interfaces_{package}", partial(build, package))
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
            known = os.environ.get("PYTHONPATH")
            os.environ["PYTHONPATH"] = f"{known}:{folder}" if known else str(folder)

    return provide
