# SPDX-License-Identifier: Apache-2.0
"""`intent export`, and back: the demonstrations are the same to the last bit."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from model_builder import write_recording
from moved_box import DOFS, hand_over

from intent_recognition.cli.main import main
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.tables import export_columns


def check_same(before, after):
    """Labels, names, stamps and values; `after` says where it was imported from."""
    assert len(before) == len(after)
    for one, other in zip(before, after, strict=True):
        told = {k: v for k, v in other.metadata.items() if k != "imported_from"}
        assert (one.name, one.task, dict(one.metadata)) == (other.name, other.task, told)
        for side in ("observed", "controlled"):
            for a, b in zip(getattr(one, side), getattr(other, side), strict=True):
                assert a.names == b.names and a.unit == b.unit
                assert a.stamps_ns.tobytes() == b.stamps_ns.tobytes()
                assert a.values.tobytes() == b.values.tobytes()


def there_and_back(bags, dofs, tmp_path, suffix) -> list:
    table, output = tmp_path / f"all{suffix and '.'}{suffix}", tmp_path / f"from_{suffix}"
    assert main(["export", *map(str, bags), "--dofs", str(dofs), "--output", str(table)]) == 0
    command = ["import", str(table), "--map", str(table.with_suffix(".map.yaml"))]
    assert main([*command, "--output", str(output)]) == 0
    found, rejections = read_demonstrations(output, load_dofs(output / "dofs.yaml"))
    assert not rejections
    return found


@pytest.mark.parametrize("suffix", ["csv", "parquet", ""])  # without: a LeRobot data set
def test_bags_come_back_the_same(suffix, repository, tmp_path):
    if suffix != "csv":
        pytest.importorskip("pyarrow")
    bags = sorted((repository / "bags/toolbox/test").iterdir())[:3]
    dofs = repository / "config/dofs.yaml"
    before, _ = read_demonstrations(bags, load_dofs(dofs))
    assert any(  # occluded samples are gaps
        np.max(np.diff(d.observed[0].stamps_ns)) > 15_000_000 for d in before
    )
    check_same(before, there_and_back(bags, dofs, tmp_path, suffix))


def test_a_context_comes_back_the_same(tmp_path):
    bag = write_recording(tmp_path / "bag", hand_over("give", 3), DOFS)
    (tmp_path / "dofs.yaml").write_text(yaml.safe_dump(DOFS.to_dict()))
    before, _ = read_demonstrations(bag, DOFS)
    after = there_and_back([bag], tmp_path / "dofs.yaml", tmp_path, "csv")
    check_same(before, after)
    np.testing.assert_array_equal(after[0].context[0].values, before[0].context[0].values)
    np.testing.assert_array_equal(after[0].context[0].stamps_ns, before[0].context[0].stamps_ns)


def test_demonstrations_of_a_session_and_of_equal_names(repository):
    session = repository / "bags/assembly/session_00"
    dofs = load_dofs(repository / "config/dofs_two_humans.yaml")
    parts, _ = read_demonstrations(session, dofs)
    named = replace(parts[1], name="session_00#000_2")
    columns = export_columns([parts[0], named, parts[0]])
    names = list(dict.fromkeys(columns["demonstration"]))
    assert names == ["session_00#000", "session_00#000_2", "session_00#000_3"]
    assert np.all(np.diff(columns["stamp_ns"][columns["demonstration"] == names[0]]) > 0)


def test_a_lerobot_data_set_has_the_schema_of_version_3(repository, tmp_path, capsys):
    """Of lerobot 0.4.4: `create_empty_dataset_info`, `_save_episode_metadata`, `load_tasks`."""
    parquet = pytest.importorskip("pyarrow.parquet")
    bags = sorted((repository / "bags/toolbox/test").iterdir())[:2]
    folder = tmp_path / "set"
    assert main(["export", *map(str, bags), "--output", str(folder)]) == 0
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["fps"]) == ("v3.0", 2, 100)
    data = parquet.read_table(folder / "data/chunk-000/file-000.parquet")
    assert set(data.column_names) == set(info["features"]) and len(data) == info["total_frames"]
    for key, feature in info["features"].items():
        kind = str(data.schema.field(key).type)
        expected = {"float64": "double", "float32": "float"}.get(feature["dtype"], feature["dtype"])
        size = feature["shape"][0]
        list_kind = f"fixed_size_list<item: {expected}>[{size}]"
        assert kind.replace("element:", "item:") == (list_kind if feature["names"] else expected)
    episodes = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [one["length"] for one in episodes] == [
        one["dataset_to_index"] - one["dataset_from_index"] for one in episodes
    ]
    assert episodes[-1]["dataset_to_index"] == info["total_frames"]
    assert main(["export", str(bags[0]), "--output", str(folder)]) == 1
    assert "got a folder. Choose another" in capsys.readouterr().err


def test_a_map_that_was_edited_by_hand_is_kept(repository, tmp_path, capsys):
    command = ["export", str(repository / "bags/toolbox/test/plate_handover_00"), "--output"]
    table = tmp_path / "a.csv"
    for _ in range(2):  # the second says the same
        assert main([*command, str(table)]) == 0
        assert capsys.readouterr().out.startswith("1 demonstration, ")
    (tmp_path / "a.map.yaml").write_text("by hand", encoding="utf-8")
    table.write_text("older", encoding="utf-8")
    assert main([*command, str(table)]) == 1
    assert "a.map.yaml, which has other content" in capsys.readouterr().err
    assert (tmp_path / "a.map.yaml").read_text() == "by hand" and table.read_text() == "older"


def test_another_suffix_is_refused(repository, tmp_path, capsys):
    bag = repository / "bags/toolbox/test/plate_handover_00"
    assert main(["export", str(bag), "--output", str(tmp_path / "a.xlsx")]) == 1
    assert ".csv or .parquet" in capsys.readouterr().err
