# SPDX-License-Identifier: Apache-2.0
"""What import makes of a file."""

import numpy as np
import yaml
from tables.exported_files import entry
from tables.odd_files import PLACE, TIMES_S

from intent_recognition.signals import Rejection
from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.import_map import ImportMap


def imported(folder, name, content, columns=("x", "y", "z"), **more):
    """Samples, or None, and what is said of a file: of this content, or one that is there."""
    path = folder / name
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    unit = {"columns_unit": more.pop("unit")} if "unit" in more else {}
    observed = [entry(list(columns), **unit)]
    mapping = ImportMap.from_dict({"observed": observed, "task": "t", **more})
    found = list(import_demonstrations(path, mapping))
    taken = [one for one in found if not isinstance(one, Rejection)]
    said = " ".join(one.reason for one in found if isinstance(one, Rejection))
    return (taken[0].samples[0] if taken else None), said


def imported_csv(folder, content, columns=("x", "y", "z"), **more):
    """Of a table of text with the times in column t."""
    return imported(folder, "a.csv", content, columns, **{"time": {"column": "t"}} | more)


def check_wrist(found, wanted=PLACE / 1000, atol=1e-8, times_atol=None):
    """Nothing is said, the places are the wrist's [m], and the times, where a tolerance says so."""
    samples, said = found
    assert not said
    np.testing.assert_allclose(samples.values, wanted, rtol=0.0, atol=atol)
    if times_atol is not None:
        since_ns = samples.stamps_ns - samples.stamps_ns[0]
        np.testing.assert_allclose(since_ns, 1e9 * TIMES_S, atol=times_atol)


def demonstrations(path, columns, task="t", rate=100, **more):
    """All that a file holds of a point in metres, and what is said of it."""
    point = {"topic": "/p", "type": "geometry_msgs/msg/Point", "fields": list("xyz"), "unit": "m"}
    time = {"rate": rate} if rate else {"column": "t"}
    mapping = {"observed": [{**point, "columns": list(columns), **more}], "task": task}
    return list(import_demonstrations(path, ImportMap.from_dict({**mapping, "time": time})))


def suggested(source):
    """The first map of a file, its text, and what it imports."""
    text = suggest_map(source)
    content = yaml.safe_load(text)
    assert "time" not in content or "# time:" not in text  # a rate that nobody said is not used
    mapping = ImportMap.from_dict({"time": {"rate": 100}, **content})
    found = list(import_demonstrations(source, mapping))
    assert found and not any(isinstance(one, Rejection) for one in found)
    return content, text, found


def suggested_csv(folder, table):
    """`suggested` of a table of text."""
    (folder / "a.csv").write_text(table, encoding="utf-8")
    return suggested(folder / "a.csv")
