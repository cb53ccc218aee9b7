# SPDX-License-Identifier: Apache-2.0
"""Files as labs send them, of one wrist."""

import numpy as np
import pytest
from scipy.io import savemat

ROWS = 200
TIMES_S = np.arange(ROWS) / 100
SHARE = np.clip(TIMES_S - 0.5, 0.0, 1.0)[:, None]
PLACE = np.array([300.0, 20.5, 900.0]) + SHARE**2 * (3 - 2 * SHARE) * np.array([300.0, 200, -100])
"""Of a wrist in millimetres, over time."""
NEXUS = "Trajectories\n100\n,,{0}:RWRA,,,{1}:RWRA,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,,,\n"
DEVICES = "Devices\n1000\n,,Plate - Force,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n"


def h5(path, arrays, units=None, **attributes):
    with pytest.importorskip("h5py").File(path, "w") as file:
        file.attrs.update(attributes)
        for name, array in arrays.items():
            file[name] = array
        for name, unit in (units or {}).items():
            file[name].attrs["units"] = unit
    return path


def mat(path, content, version):
    """A MAT file of a version, of arrays, texts, dictionaries (structs) and lists (cells, or arrays
    of structs).
    """
    h5py = pytest.importorskip("h5py")  # also reads which version it is
    if version == 5:
        savemat(path, content)
        return path

    def write(group, key, value, kind=None):
        if isinstance(value, dict):
            made = group.create_group(key)
            for name, one in value.items():
                write(made, name, one)
            kind = "struct"
        elif isinstance(value, list) and isinstance(value[0], dict):
            fields = {name: [one[name] for one in value] for name in value[0]}
            made = group.create_group(key)
            for name, column in fields.items():
                write(made, name, column, kind="")
            kind = "struct"
        elif isinstance(value, list):
            cells = [write(file["#refs#"], f"{len(file['#refs#'])}", one).ref for one in value]
            made = group.create_dataset(key, data=np.array(cells, h5py.ref_dtype)[:, None])
            kind = "cell" if kind is None else kind
        else:
            is_text = isinstance(value, str)
            array = [[ord(c) for c in value]] if is_text else np.atleast_2d(value)
            made = group.create_dataset(key, data=np.array(array, "u2" if is_text else None).T)
            kind = "char" if is_text else "double"
        if kind:
            made.attrs["MATLAB_class"] = np.bytes_(kind)
        return made

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for key, value in content.items():
            write(file, key, value)
        empty = write(file, "nothing", np.zeros((1, 2)))
        empty.attrs["MATLAB_empty"] = 1
    return path


def parquet_file(path, columns):
    table = pytest.importorskip("pyarrow").table(columns)
    pytest.importorskip("pyarrow.parquet").write_table(table, path)
    return path


def in_turns(k, *two):
    """Trackers list what they see, in any order."""
    return two[:: 1 - 2 * (k % 2)]


def of_bodies(key, cup, wrist):
    both = ({key: cup, "at": [0.0] * 3}, {key: wrist})
    return [
        [*in_turns(k, both[0], both[1] | {"at": place})]
        for k, place in enumerate((PLACE / 1000).tolist())
    ]


def cells(k, form="{:.6f}", scale=1.0):
    return [form.format(value * scale) for value in PLACE[k]]


def table(head, row, separator=","):
    return head + "\n" + "".join(separator.join(row(k)) + "\n" for k in range(ROWS))


def csv_of(head, *columns, end=""):
    """Arrays (T,) or (T, d) side by side below a head, if there is one."""
    rows = [",".join(f"{cell:.9f}" for cell in row) for row in np.column_stack(columns)]
    return "\n".join([*filter(None, [head]), *rows, end])


def day_time(seconds):
    return f"{seconds // 3600 % 24:02.0f}:{seconds // 60 % 60:02.0f}:{seconds % 60:06.3f}"


def plain(
    form="{:.6f}", scale=1.0, separator=",", head="t,x,y,z", hidden=(), cell="", at="{:.3f}".format
):
    def row(k):
        places = [cell] * 3 if k in hidden else cells(k, form, scale)
        return [at(TIMES_S[k]), *places]

    return table(head.replace(",", separator), row, separator)


def nexus(rows, owners=("Ann", "Bob"), before=""):
    body = "".join(f"{k + 1},0,{','.join(cells(k))},,,\n" for k in rows)
    return before + NEXUS.format(*owners) + body
