# SPDX-License-Identifier: Apache-2.0
"""What the browsers on the page may send, checked as it is decoded. No ROS, no viser.

viser knows more messages (uploads, a public tunnel): nothing here asks for them.
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
    """From where a browser looks: all that an onlooker's may send."""

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
    """A control is changed or pressed."""

    uuid: Text
    updates: _NewValue


class GrabHandle(_Sent, tag=GRAB):
    """A handle is taken."""

    name: Text


class DragHandle(_Sent, tag=DRAG):
    """It is moved."""

    name: Text
    wxyz: Quaternion
    position: Vector


class LeaveHandle(_Sent, tag=LEAVE):
    """It is let go."""

    name: Text


Action = ChangeControl | GrabHandle | DragHandle | LeaveHandle
_DECODER = msgspec.msgpack.Decoder(LookFrom | Action)


def read_message(data: bytes | str) -> LookFrom | Action | None:
    """What a browser has sent; None where this page's controls send no such thing."""
    try:
        return _DECODER.decode(data if isinstance(data, bytes) else b"")
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None


def can_become(value: ControlValue, present: object, options: Sequence[str] | None = None) -> bool:
    """Whether a browser can give this value to a control that has another, and offers options.

    Without options it may have any value of the same kind.
    """
    if isinstance(present, tuple):
        return isinstance(value, list) and len(value) == len(present)
    if isinstance(present, (bool, str)):
        return type(value) is type(present) and (options is None or value in options)
    return isinstance(value, float)
