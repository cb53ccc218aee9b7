# SPDX-License-Identifier: Apache-2.0
"""Files as programs export them, of one wrist; `python -m tables.exported_files` from `test` writes
docs/formats.md, a section for each with the map that is suggested of it."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from c3d_builder import c3d_file
from tables.odd_files import h5, parquet_file

from intent_recognition.tables import suggest_map

ROWS = 30
PLACE = np.column_stack([300.0 + np.arange(ROWS), np.full(ROWS, 20.5), np.full(ROWS, 900.0)])
"""Of a wrist in millimetres, over time."""


def entry(columns, **more):
    return {
        "topic": "/mocap/wrist/pose",
        "type": "geometry_msgs/msg/PoseStamped",
        "fields": [f"pose.position.{axis}" for axis in "xyz"],
        "unit": "m",
        "columns": columns,
        **more,
    }


def kept(path, content):
    """The path of a file with some content."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def rows(before, separator=",", decimals=".", scale=1.0):
    """Lines of a table: what `before` says of a row, then the wrist."""
    cells = ([*before(k), *(f"{v:.6f}" for v in place * scale)] for k, place in enumerate(PLACE))
    return "".join(separator.join(row).replace(".", decimals) + "\n" for row in cells)


def motive(folder):
    kinds = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
    head = [
        "Format Version,1.23,Take Name,a,Export Frame Rate,120.0,Rotation Type,Quaternion,"
        "Length Units,Millimeters,Coordinate Space,Global",
        "",
        ",Type" + ",Rigid Body" * 8,
        ",Name" + ",wrist" * 8,
        ",ID" + ",A1" * 8,
        ",," + ",".join(kinds),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,",
    ]
    body = [f"{k},{k / 120:.6f},0,0,0,1,{x},{y},{z},0.1" for k, (x, y, z) in enumerate(PLACE)]
    return kept(folder / "motive.csv", "\n".join([*head, *body]) + "\n")


def nexus(folder):
    head = "Trajectories\n100\n,,Ann:RWRA,,,Ann:LWRA,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n"
    head += ",,mm,mm,mm,mm,mm,mm\n"
    body = "".join(f"{k + 1},0,{x},{y},{z},,,\n" for k, (x, y, z) in enumerate(PLACE))
    return kept(folder / "nexus.csv", f"{head}{body}\nDevices\n1000\n,,Force\nFrame,Sub Frame,Fx\n")


def trc(folder):
    head = (
        "PathFileType\t4\t(X/Y/Z)\ta.trc\n"
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
        f"100\t100\t{ROWS}\t2\tmm\nFrame#\tTime\tLWR\t\t\tRWR\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    )
    return kept(
        folder / "a.trc", head + rows(lambda k: [str(k + 1), f"{k / 100:.3f}", "", "", ""], "\t")
    )


def qtm(folder):
    head = (
        f"NO_OF_FRAMES\t{ROWS}\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t1\nFREQUENCY\t100\n"
        "DATA_INCLUDED\t3D\nMARKER_NAMES\twrist\n"
    )
    return kept(folder / "qtm.tsv", head + rows(lambda k: [], "\t"))


def opensim(folder):
    head = f"model\nversion=1\nnRows={ROWS}\nnColumns=5\ninDegrees=yes\nendheader\n"
    head += "time\telbow\twrist_tx\twrist_ty\twrist_tz\n"
    return kept(
        folder / "a.mot", head + rows(lambda k: [f"{k / 100:.3f}", "90"], "\t", scale=0.001)
    )


def german_excel(folder):
    head = "Zeit [s];Größe;x;y;z\n"
    text = head + rows(lambda k: [f"{k / 100:.3f}", "groß"], ";", ",")
    return kept(folder / "excel.csv", text.encode("latin-1"))


def utf16(folder):
    text = "t\tx\ty\tz\n" + rows(lambda k: [f"{k / 100:.3f}"], "\t")
    return kept(folder / "unicode.txt", text.encode("utf-16"))


def without_names(folder):
    return kept(folder / "plain.csv", rows(lambda k: [f"{k / 100:.3f}"]))


def c3d(folder):
    points = np.stack([PLACE, PLACE + 100.0], axis=1)
    return kept(folder / "a.c3d", c3d_file(points, labels=["RWRA", "LWRA"]))


def bvh(folder):
    text = f"""HIERARCHY
ROOT Hips
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Right Wrist
  {{
    OFFSET 0 500 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {{
      OFFSET 0 80 0
    }}
  }}
}}
MOTION
Frames: {ROWS}
Frame Time: 0.01
"""  # the hips turn by 90 degrees about z: the wrist is 500 to their left
    body = "".join(f"{x + 500} {y} {z} 90 0 0 0 0 0\n" for x, y, z in PLACE)
    return kept(folder / "a.bvh", text + body)


def mvnx(folder):
    frames = "".join(
        f'<frame time="{10 * k}" type="normal"><position>{x / 1000} {y / 1000} {z / 1000}'
        "</position><orientation>1 0 0 0</orientation></frame>"
        for k, (x, y, z) in enumerate(PLACE)
    )
    (folder / "a.mvnx").write_text(
        '<mvnx xmlns="http://www.xsens.com/mvn/mvnx"><subject frameRate="100"><segments>'
        '<segment label="RightHand" id="1"/></segments><frames>'
        '<frame time="0" type="identity"><position>0 0 0</position></frame>'
        f"{frames}</frames></subject></mvnx>"
    )
    return folder / "a.mvnx"


def robomimic(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "demos.hdf5", "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_kwargs": {"control_freq": 100}})
        for k in range(2):
            demo = data.create_group(f"demo_{k}")
            demo["obs/robot0_eef_pos"] = PLACE / 1000
            demo["actions"] = np.zeros((ROWS, 7))
            demo["obs/image"] = np.zeros((ROWS, 4, 4, 3), np.uint8)
    return folder / "demos.hdf5"


def aloha(folder):
    joints = np.hstack([np.zeros((ROWS, 2)), PLACE / 1000])
    arrays = {"observations/qpos": joints, "action": np.zeros((ROWS, 14))}
    return h5(folder / "episode_0.hdf5", arrays)


def openpose(folder):
    (folder / "video").mkdir()
    for k, (x, y, z) in enumerate(PLACE):
        points = np.zeros((25, 4))
        points[4] = x / 1000, y / 1000, z / 1000, 0.9
        content = {"people": [{"pose_keypoints_3d": points.ravel().tolist()}]}
        (folder / f"video/a_{k:012d}_keypoints.json").write_text(json.dumps(content))
    return folder / "video"


def mediapipe(folder):
    def landmarks(k, scale):
        points = [{"x": 0.0, "y": 0.0, "z": 0.0} for _ in range(33)]
        points[16] = dict(zip("xyz", (PLACE[k] * scale).tolist(), strict=True))
        return points

    frames = [
        {"timestamp_ms": 10 * k, "pose_landmarks": landmarks(k, 1e-4),
         "pose_world_landmarks": landmarks(k, 1e-3)}
        for k in range(ROWS)
    ]  # fmt: skip
    return kept(folder / "a.json", json.dumps({"frames": frames}))


TASKS = "Hand me the plate.", "Take the screw."


def lerobot_set(folder, states, names, version="v3.0"):
    """A data set of two episodes, in 10 Hz, as LeRobot writes it; states (2, T, d)."""
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    count, width = states.shape[1:]
    state = {"dtype": str(states.dtype), "shape": [width], "names": {"motors": names}}
    info = {"codebase_version": version, "fps": 10, "features": {"observation.state": state}}
    is_old = version.startswith("v2")
    name = "episode_{episode_index:06d}" if is_old else "file-{file_index:03d}"
    chunk = "{episode_chunk:03d}" if is_old else "{chunk_index:03d}"
    info["data_path"] = f"data/chunk-{chunk}/{name}.parquet"
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    episodes = [
        arrow.table({
            "observation.state": list(states[k]),
            "timestamp": (np.arange(count) / 10).astype(np.float32),
            "episode_index": np.full(count, k),
            "task_index": np.full(count, 1 - k),
        })
        for k in range(2)
    ]  # fmt: skip
    if is_old:
        for k, table in enumerate(episodes):
            parquet.write_table(table, folder / f"data/chunk-000/episode_{k:06d}.parquet")
        lines = [json.dumps({"task_index": k, "task": text}) for k, text in enumerate(TASKS)]
        (folder / "meta/tasks.jsonl").write_text("\n".join(lines) + "\n")
    else:
        path = folder / "data/chunk-000/file-000.parquet"
        parquet.write_table(arrow.concat_tables(episodes), path)
        tasks = arrow.table({"task_index": [0, 1], "__index_level_0__": TASKS})
        parquet.write_table(tasks, folder / "meta/tasks.parquet")
    return folder


def lerobot(folder):
    names = ["wrist.x", "wrist.y", "wrist.z", "shoulder", "elbow"]
    states = np.hstack([PLACE / 1000, np.linspace(0, (0.4, 0.9), ROWS)])
    return lerobot_set(folder / "set", np.stack([states] * 2), names)


def deeplabcut(folder):
    head = "scorer,a,a,a\nbodyparts,wrist,wrist,wrist\ncoords,x,y,z\n"
    return kept(folder / "dlc.csv", head + rows(lambda k: [f"{k}"]))


def parquet(folder):
    columns = {"t": np.arange(ROWS) / 100, "wrist_pos": list(PLACE / 1000)}
    return parquet_file(folder / "a.parquet", columns)


def npz(folder):
    np.savez(folder / "a.npz", t=np.arange(ROWS) / 100, wrist_pos=PLACE / 1000)
    return folder / "a.npz"


def three(start):
    return [f"{start}.{axis}" for axis in "xyz"]


EXAMPLES = {
    "Motive, CSV": (motive, [f"wrist.Position.{axis}" for axis in "XYZ"], {}),
    "Nexus, CSV": (nexus, [f"RWRA.{axis}" for axis in "XYZ"], {}),
    "OpenSim, TRC": (trc, three("RWR"), {}),
    "QTM, TSV": (qtm, three("wrist"), {}),
    "OpenSim, MOT": (opensim, [f"wrist_t{axis}" for axis in "xyz"], {}),
    "DeepLabCut, CSV": (deeplabcut, three("wrist"), {"time": {"rate": 100}}),
    "Excel, CSV": (german_excel, ["x", "y", "z"], {"time": {"column": "Zeit [s]"}}),
    "Excel, text in UTF-16": (utf16, ["x", "y", "z"], {"time": {"column": "t"}}),
    "CSV without names": (without_names, [1, 2, 3], {"time": {"column": 0}}),
    "C3D": (c3d, three("RWRA"), {}),
    "BVH": (bvh, three("Right Wrist"), {}),
    "Xsens, MVNX": (mvnx, three("RightHand.position"), {}),
    "robomimic, HDF5": (robomimic, [f"obs.robot0_eef_pos.{k}" for k in range(3)], {}),
    "ALOHA, HDF5": (
        aloha, [f"observations.qpos.{k}" for k in (2, 3, 4)], {"time": {"rate": 100}}
    ),
    "OpenPose, JSON": (openpose, three("RWrist"), {"time": {"rate": 100}}),
    "MediaPipe, JSON": (mediapipe, three("right_wrist"), {}),
    "LeRobot, version 2 or 3": (lerobot, three("observation.state.wrist"), {}),
    "pandas, Parquet": (parquet, [f"wrist_pos.{k}" for k in range(3)], {"time": {"column": "t"}}),
    "numpy, NPZ": (npz, [f"wrist_pos.{k}" for k in range(3)], {"time": {"column": "t"}}),
}  # fmt: skip
"""By exporter and format: its file, the columns of the wrist, and what else the map must say."""
SAY_MM = ("DeepLabCut, CSV", "Excel, CSV", "Excel, text in UTF-16", "CSV without names", "BVH")
"""Those whose files do not say the unit."""


PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
PREFACE = (
    "# Formats, one by one\n\nFor a small file of each kind a test shows the map that"
    " `intent import FILE --suggest` writes. Delete what you do not need, name topics and task, and"
    " import with the map. [Recordings in other formats](import.md) explains the keys; a map for"
    " ROS bags is [suggested](import.md#a-first-map) in the same way.\n"
)
LEFT_OUT = "# Suggested", "# Delete", "# They"
"""Lines of a suggestion that say the same of every file, or nothing of its format."""


def section(kind: str, folder: Path) -> str:
    """The section of a format: the map that is suggested of its file, which is made in a folder."""
    text = suggest_map(EXAMPLES[kind][0](folder))
    lines = [line for line in text.splitlines() if not line.startswith(LEFT_OUT)]
    return "\n".join([f"## {kind}", "", "```yaml", *lines, "```", ""])


if __name__ == "__main__":
    sections = [PREFACE]
    for name in EXAMPLES:
        with TemporaryDirectory() as made:
            sections.append(section(name, Path(made)))
    PAGE.write_text("\n".join(sections), encoding="utf-8")
