# SPDX-License-Identifier: Apache-2.0
"""`intent --print-completion`: the script is right, and the shells complete with it."""

import os
import re
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


def shell(name):
    """The shell; without it the test is skipped, but not where CI runs."""
    if shutil.which(name) is None:
        reason = f"no {name}: sudo .ci/install_system_packages"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return name


TYPED_IN_ZSH = r"""
zmodload zsh/zpty
zpty z zsh -f -i
zpty -w z "PS1=; autoload -Uz compinit; compinit -u -D; eval \"\$(<'$1')\""
zpty -w z 'shown() { print -r -- "<""$BUFFER"">"; BUFFER="" }; zle -N shown; bindkey "^X" shown'
zpty -w z 'print REA""DY'
zpty -r z seen '*READY*'
zpty -w -n z "$2"$'\t\x18'
zpty -r z seen '*<intent*>*'
print -r -- $seen
"""
"""Line and tab key go to an interactive zsh; a key of ours then prints what has become of them."""


def typed_in_zsh(script, cwd, line):
    """What an interactive zsh makes of a line and the tab key."""
    command = [shell("zsh"), "-f", "-c", TYPED_IN_ZSH, "zsh", str(script), line]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=cwd, timeout=60)
    return re.findall(r"<(intent[^>]*)>", done.stdout)[-1]


@pytest.mark.parametrize(
    ("typed", "becomes"),
    [
        ("intent trai", "intent train "),
        ("intent replay --mod", "intent replay --model "),
        ("intent train --segment mov", "intent train --segment movement "),
        ("intent train demos give", "intent train demos give_bracket_00/"),
        ("intent experiments pole al", "intent experiments pole alignment "),
    ],
)
def test_zsh_completes(scripts, tmp_path, typed, becomes):
    (tmp_path / "give_bracket_00").mkdir()
    assert becomes == typed_in_zsh(scripts / "zsh", tmp_path, typed)


@pytest.mark.parametrize("name", ["bash", "fish"])
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("intent ", {*cli.COMMANDS}),
        ("intent re", {"record", "recover", "rehearse", "replay"}),
        ("intent replay --mo", {"--model"}),
        ("intent train --segment ", {"movement", "recording"}),
        ("intent train demos give", {"give_bracket_00"}),
        ("intent experiments pole al", {"alignment"}),
    ],
)
def test_bash_and_fish_complete(scripts, tmp_path, name, typed, offered):
    (tmp_path / "give_bracket_00").mkdir()
    if name == "bash":
        _, *words = typed.split(" ")
        found = completed(scripts / "bash", tmp_path, *words)
    else:
        program = f"source {scripts / 'fish'}; complete -C '{typed}'"
        command = [shell("fish"), "--no-config", "-c", program]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
        found = {line.partition("\t")[0].removesuffix("/") for line in done.stdout.splitlines()}
    assert found - {"-h", "--help"} == offered
