# SPDX-License-Identifier: Apache-2.0
"""Which files a recording is made of, and what its metadata.yaml says."""

from pathlib import Path

from intent_recognition.bags.mcap.scan import MAGIC
from intent_recognition.bags.metadata import FILE_NAME, BagMetadata, read_metadata
from intent_recognition.errors import BagError


def find_metadata(path: Path, *, tolerant: bool) -> tuple[BagMetadata | None, list[str]]:
    """What metadata.yaml says and what is odd about it; None for a single file or without it.

    Args:
        path: bag directory, or a single .mcap file.
        tolerant: do without a metadata.yaml that cannot be used.

    Raises:
        BagError: nothing is there, it is no bag, or one of another storage or compression.
    """
    if not path.exists():
        raise BagError.about(str(path), "a bag", "nothing there", "Check the path.")
    if path.is_file():
        _check_file(path)
        return None, []
    if not any(path.glob("*.mcap")) and not (path / FILE_NAME).exists():
        n_bags = sum(1 for _ in path.glob(f"*/{FILE_NAME}"))
        storage = "the storage of recordings is MCAP (`ros2 bag record -s mcap`)"
        cure = cure_of(path, f"Check the path; {storage}.")
        got = f"a folder of {n_bags} bags" if n_bags else "a folder without .mcap files"
        raise BagError.about(str(path), "a bag", got, "Name one." if n_bags else cure)
    try:
        metadata = read_metadata(path)
    except BagError as error:
        if not any(path.glob("*.mcap")):
            cure = "Record with MCAP storage (`ros2 bag record -s mcap`)."
            raise BagError.about(str(path), "a bag", error, cure) from error
        if (path / FILE_NAME).exists() and not tolerant:
            raise
        return None, [f"no usable {FILE_NAME}"]
    if metadata.storage != "mcap" or metadata.compression:
        got = f"storage {metadata.storage} {metadata.compression}".strip()
        cure = "`ros2 bag convert` it to mcap, with its label as custom_data (docs/bags.md)."
        raise BagError.about(str(path), "uncompressed MCAP storage", got, cure)
    return metadata, []


TABLES = (".csv", ".tsv", ".parquet", ".c3d")
"""Files that are no bags, but can become some."""


def cure_of(path: Path, otherwise: str) -> str:
    """What helps where a path holds no bag: to import it, if it is a table or a folder of them."""
    files = path.iterdir() if path.is_dir() else [path]
    tables = any(file.suffix.lower() in TABLES for file in files)
    return "Make bags of tables with `intent import` (docs/import.md)." if tables else otherwise


def _check_file(path: Path) -> None:
    """Whether a single file can be a recording; one that ends in .mcap may be a damaged one."""
    if path.suffix != ".mcap":
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                cure = cure_of(path, "Give a bag: a folder with .mcap files, or one of them.")
                raise BagError.about(str(path), "a recording", "another kind of file", cure)


def find_files(
    path: Path, metadata: BagMetadata | None, *, tolerant: bool
) -> tuple[list[Path], list[str]]:
    """The MCAP files of a recording in their order, and what is odd about them.

    Args:
        path: bag directory, or a single .mcap file.
        metadata: of the bag; without it all .mcap files count, sorted by name and number.
        tolerant: do without files that are missing.

    Raises:
        BagError: a file is missing, or there is none.
    """
    if path.is_file():
        return [path], []
    if metadata is None or not metadata.files:
        files = _mcap_files(path)
    else:
        files = [path / name for name in metadata.files]
    missing = [file.name for file in files if not file.is_file()]
    notes = []
    if tolerant and missing:
        notes.append(f"missing: {', '.join(missing)}")
        files = [file for file in files if file.is_file()] or _mcap_files(path)
        missing = []
    if missing or not files:
        cure = "Copy the whole directory of the bag."
        got = f"no {', '.join(missing) or '.mcap file'}"
        raise BagError.about(str(path), "the files of the bag", got, cure)
    return files, notes


def _mcap_files(folder: Path) -> list[Path]:
    """All files that may be read to their end (a FIFO never ends), by name and number."""
    return sorted((path for path in folder.glob("*.mcap") if path.is_file()), key=_name_and_number)


def _name_and_number(path: Path) -> tuple[str, int]:
    """rosbag2 numbers the files of a bag: NAME_10 comes after NAME_9."""
    name, _, number = path.stem.rpartition("_")
    return (name, int(number)) if number.isdecimal() else (path.stem, -1)
