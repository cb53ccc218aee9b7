# SPDX-License-Identifier: Apache-2.0
"""Messages that a browser may send to the page, checked while they are decoded. No ROS, no viser.

Other messages that viser knows (uploads, a public tunnel) are not accepted.
"""

from collections.abc import Sequence
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

GRAB, DRAG, LEAVE = (
    f"TransformControls{phase}Message" for phase in ("DragStart", "Update", "DragEnd")
)
Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
Text = Annotated[str, Meta(max_length=1000)]
Vector = tuple[Number, Number, Number]
Quaternion = tuple[Number, Number, Number, Number]
ControlValue = bool | Number | Text | Annotated[list[Number], Meta(max_length=64)]


class _Sent(Struct, tag_field="type", forbid_unknown_fields=True, kw_only=True):
    owner: Any = None


class LookFrom(_Sent, tag="ViewerCameraMessage"):
    """The camera pose of a browser: the only message accepted from an onlooker."""

    wxyz: Quaternion
    position: Vector
    fov: Number
    near: Number
    far: Number
    image_height: Number
    image_width: Number
    look_at: Vector
    up_direction: Vector


class _NewValue(Struct, forbid_unknown_fields=True):
    value: ControlValue


class ChangeControl(_Sent, tag="GuiUpdateMessage"):
    """A person changed or pressed a control."""

    uuid: Text
    updates: _NewValue


class GrabHandle(_Sent, tag=GRAB):
    """A person grabbed a drag handle."""

    name: Text


class DragHandle(_Sent, tag=DRAG):
    """A person moved a drag handle."""

    name: Text
    wxyz: Quaternion
    position: Vector


class LeaveHandle(_Sent, tag=LEAVE):
    """A person let go of a drag handle."""

    name: Text


Action = ChangeControl | GrabHandle | DragHandle | LeaveHandle
_DECODER = msgspec.msgpack.Decoder(LookFrom | Action)


def read_message(data: bytes | str) -> LookFrom | Action | None:
    """Decode a message of a browser; None if this page's controls cannot send it."""
    try:
        return _DECODER.decode(data if isinstance(data, bytes) else b"")
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None


def can_become(value: ControlValue, present: object, options: Sequence[str] | None = None) -> bool:
    """Whether a browser may change a control from `present` to `value`.

    The value must be among the options, if there are any, and of the same type as `present`.
    """
    if isinstance(present, tuple):
        return isinstance(value, list) and len(value) == len(present)
    if isinstance(present, (bool, str)):
        return type(value) is type(present) and (options is None or value in options)
    return isinstance(value, float)
