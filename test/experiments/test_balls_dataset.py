# SPDX-License-Identifier: Apache-2.0
"""Making the trials: goes on after an interruption, and reads back what it wrote."""

import numpy as np
import pytest

from experiments.constraints import dataset
from experiments.constraints.trials import COLUMNS, blocks
from experiments.constraints.trials_file import read_trials, write_trials
from intent_recognition.errors import ModelError


def rows():
    rng = np.random.default_rng(0)
    return {name: rng.random((6, len(columns))) for name, columns in COLUMNS.items()}


def unfinished(output, seed, done):
    """A folder as an interrupted run leaves it: `done` blocks, each row its block's number."""
    origin = {"seed": seed, "trials_per_object": 1, "container_seed": dataset.CONTAINER_SEED}
    parts = dataset._parts_folder(output, origin)
    for number, block in enumerate(blocks(seed, 1)[:done]):
        np.save(dataset._part(parts, block), np.full((1, len(COLUMNS[block.experiment])), number))
    return parts


@pytest.mark.slow
def test_goes_on_where_it_was_interrupted(tmp_path):
    output = tmp_path / "trials.npz"
    parts = unfinished(output, 3, done=19)
    (parts / "filling_square_bowl_00.half").write_bytes(b"half written")
    told = []
    made = dataset.generate(output, 3, trials=1, jobs=1, progress=lambda *what: told.append(what))
    assert told[0] == ("found", 19, 20)
    assert told[-1] == ("filling_square_bowl_00", 20, 20)
    np.testing.assert_array_equal(made["pouring"][:, 0], np.arange(10))
    assert not parts.exists()
    trials = read_trials(output)
    assert trials.origin["seed"] == 3
    assert trials.tables["filling"]["object"][-1] == 9.0
    assert trials.tables["filling"]["through_wall"][-1] == 0.0


def test_refuses_what_is_no_table_of_trials(tmp_path):
    path = tmp_path / "trials.npz"
    with pytest.raises(ModelError, match="dataset"):
        read_trials(path)
    path.write_bytes(b"PK no archive")
    with pytest.raises(ModelError):
        read_trials(path)
    write_trials(path, rows(), {"seed": 1, "format": 99})
    with pytest.raises(ModelError, match="format"):
        read_trials(path)
    write_trials(path, rows() | {"filling": np.zeros((3, 2))}, {"seed": 1})
    with pytest.raises(ModelError, match="filling"):
        read_trials(path)
    write_trials(path, rows() | {"pouring": np.full((3, 5), np.nan)}, {"seed": 1})
    with pytest.raises(ModelError, match="finite"):
        read_trials(path)
