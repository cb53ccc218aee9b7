# SPDX-License-Identifier: Apache-2.0
"""Files as labs send them, of one wrist, and what import makes of one."""

import numpy as np
from tables.exported_files import entry

from intent_recognition.signals import Rejection
from intent_recognition.tables import import_demonstrations
from intent_recognition.tables.import_map import ImportMap

ROWS = 200
TIMES_S = np.arange(ROWS) / 100
SHARE = np.clip(TIMES_S - 0.5, 0.0, 1.0)[:, None]
PLACE = np.array([300.0, 20.5, 900.0]) + SHARE**2 * (3 - 2 * SHARE) * np.array([300.0, 200, -100])
"""Of a wrist in millimetres, over time."""
NEXUS = "Trajectories\n100\n,,{0}:RWRA,,,{1}:RWRA,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,,,\n"
DEVICES = "Devices\n1000\n,,Plate - Force,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n"


def cells(k, form="{:.6f}", scale=1.0):
    return [form.format(value * scale) for value in PLACE[k]]


def table(head, row, separator=","):
    return head + "\n" + "".join(separator.join(row(k)) + "\n" for k in range(ROWS))


def day_time(seconds):
    return f"{seconds // 3600 % 24:02.0f}:{seconds // 60 % 60:02.0f}:{seconds % 60:06.3f}"


def plain(
    form="{:.6f}", scale=1.0, separator=",", head="t,x,y,z", hidden=(), cell="", at="{:.3f}".format
):
    def row(k):
        places = [cell] * 3 if k in hidden else cells(k, form, scale)
        return [at(TIMES_S[k]), *places]

    return table(head.replace(",", separator), row, separator)


def imported(folder, name, content, columns=("x", "y", "z"), **more):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    unit = {"columns_unit": more.pop("unit")} if "unit" in more else {}
    observed = [entry(list(columns), **unit)]
    mapping = ImportMap.from_dict({"observed": observed, "task": "t", **more})
    found = list(import_demonstrations(path, mapping))
    taken = [one for one in found if not isinstance(one, Rejection)]
    said = " ".join(one.reason for one in found if isinstance(one, Rejection))
    return (taken[0].samples[0] if taken else None), said


def nexus(rows, owners=("Ann", "Bob"), before=""):
    body = "".join(f"{k + 1},0,{','.join(cells(k))},,,\n" for k in rows)
    return before + NEXUS.format(*owners) + body
