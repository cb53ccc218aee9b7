# SPDX-License-Identifier: Apache-2.0
"""Layout of `intent --help` and of each command's help."""

import argparse

GROUPS = {
    "see it work": {
        "demo": "run the whole system with a simulated coworker and arm",
        "experiments": "reproduce the results of the papers, beside the published ones",
    },
    "from recordings to a model": {
        "inspect": "show what is in a recording or model, and how tasks have done",
        "segment": "cut a session into demonstrations",
        "train": "learn from demonstrations",
        "evaluate": "score on recordings left out of training",
        "rehearse": "before deployment: how often a model acts wrongly, and what to show it next",
        "replay": "show how the tasks are recognised during a recording",
        "explain": "say why each decision during a recording was taken",
    },
    "record and play": {
        "record": "record topics into a bag until Ctrl-C",
        "play": "play a bag onto its topics",
        "recover": "save what can be saved from a damaged recording",
    },
    "files of others": {
        "import": "make bags from CSV, C3D, BVH, HDF5, Parquet, LeRobot data sets and other bags",
        "export": "write demonstrations as a table, CSV or Parquet, or as a LeRobot data set",
    },
    "teach while the nodes run": {
        "teach": "record a task, learn it and use it at once",
        "keep": "learn from the last execution that a person corrected by hand",
        "undo": "undo the last change that teach or keep made",
    },
    "compose skills": {"plan": "learn the order of an assembly's steps from sessions"},
    "practise": {"improve": "let the robot practise a task to lower its cost"},
    "measure objects": {"warp": "measure a container by warping an annotated one onto it"},
}
"""The commands by purpose, in the order of the help, with a line on each."""

COMMANDS = {name: what for commands in GROUPS.values() for name, what in commands.items()}

HEADING = "examples:\n"


class Formatter(argparse.HelpFormatter):
    """Wraps descriptions, keeps examples as written, and lists commands by group."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith(HEADING):
            return "".join(f"{indent}{line}\n" for line in text.splitlines())
        return super()._fill_text(text, width, indent)

    def _format_action(self, action: argparse.Action) -> str:
        if not isinstance(action, argparse._SubParsersAction):
            return super()._format_action(action)
        choices = {choice.dest: choice for choice in action._choices_actions}
        self._indent()
        parts = [self._format_action(one) for name, one in choices.items() if name not in COMMANDS]
        for title, commands in GROUPS.items():
            if present := [choices[command] for command in commands if command in choices]:
                parts.append(f"\n{' ' * self._current_indent}{title}\n")
                self._indent()
                parts += [self._format_action(one) for one in present]
                self._dedent()
        self._dedent()
        return "".join(parts)
