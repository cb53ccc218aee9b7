# SPDX-License-Identifier: Apache-2.0
"""`intent --print-completion`: the script is right, and bash completes with it."""

import shutil
import subprocess

import pytest

from intent_recognition.cli import completion
from intent_recognition.cli import main as cli


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    for shell in completion.SHELLS:
        text = completion.completion(cli.make_parser(), shell)
        (folder / shell).write_text(text, encoding="utf-8")
    return folder


def completed(script, cwd, *words):
    """What bash offers for the last word."""
    program = (
        f'source "{script}"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=();'
        " $(complete -p intent | sed 's/.*-F \\([^ ]*\\).*/\\1/')"
        ' intent "${COMP_WORDS[-1]}" "${COMP_WORDS[-2]}"; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    command = ["bash", "--norc", "-c", program, "bash", "intent", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=cwd)
    return set(done.stdout.split())


def test_commands_are_offered(scripts, tmp_path):
    assert set(cli.COMMANDS) <= completed(scripts / "bash", tmp_path, "")
    assert completed(scripts / "bash", tmp_path, "re") == {"replay", "record", "recover"}


def test_options_and_choices_are_offered(scripts, tmp_path):
    assert {"--model", "--json"} <= completed(scripts / "bash", tmp_path, "replay", "--")
    offered = completed(scripts / "bash", tmp_path, "train", "--segment", "")
    assert {"movement", "recording"} <= offered


def test_paths_are_offered(scripts, tmp_path):
    (tmp_path / "give_bracket_00").mkdir()
    assert "give_bracket_00" in completed(scripts / "bash", tmp_path, "inspect", "give")


def test_the_script_for_zsh_is_valid(scripts):
    if shutil.which("zsh") is None:
        pytest.skip("no zsh")
    subprocess.run(["zsh", "-n", str(scripts / "zsh")], check=True)


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_the_option_prints_it(scripts, shell, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--print-completion", shell])
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == (scripts / shell).read_text("utf-8").strip()


def test_without_the_library_it_says_so_in_one_line(monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "shtab", None)
    with pytest.raises(SystemExit) as ended:
        cli.main(["--print-completion", "bash"])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 1 and "pip install shtab" in line
