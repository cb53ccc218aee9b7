# SPDX-License-Identifier: Apache-2.0
"""`intent recover` saves the rest of a damaged recording and says what is lost."""

import json

import pytest
from bag_builder import raw, write_bag

from intent_recognition.bags.reader import BagReader
from intent_recognition.errors import ResourceBusyError


@pytest.mark.slow
def test_a_truncated_bag_is_saved_up_to_the_cut(run_command, tmp_path):
    bag = write_bag(tmp_path / "whole", count=3000)
    whole = raw(bag, BagReader)
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    code, output = run_command("recover", bag, "--output", tmp_path / "saved")
    saved = raw(tmp_path / "saved", BagReader)
    assert code == 0
    assert 0 < len(saved) < len(whole)
    assert saved == whole[: len(saved)]
    assert BagReader(tmp_path / "saved").custom_data["task"] == "plate"
    assert output.startswith(f"saved {len(saved)} messages over ")
    assert "damaged at byte" in output


def test_a_script_gets_json(run_command, tmp_path):
    bag = write_bag(tmp_path / "whole")
    _, output = run_command("recover", bag, "--output", tmp_path / "copy", "--json")
    content = json.loads(output)
    assert content["message_counts"] == {"/joint_states": 50, "/mocap/wrist/pose": 50}
    assert content["message_count"] == 100 and content["damage"] == []


def test_an_existing_output_is_not_touched(run_command, tmp_path):
    bag = write_bag(tmp_path / "whole")
    other = write_bag(tmp_path / "other", count=3)
    before = raw(other, BagReader)
    with pytest.raises(ResourceBusyError, match="other"):
        run_command("recover", bag, "--output", other)
    assert raw(other, BagReader) == before
