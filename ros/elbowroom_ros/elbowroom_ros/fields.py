"""Access to the fields of ROS messages by name, through the members that all generated classes have."""

import importlib
import math
import re

FIELD = re.compile(r"\{([\w.]+)\}")


class FieldError(Exception):
    """A value does not fit the field of a message."""


def member(message, path):
    """Returns the value of a field: `pose.position.x`."""
    for name in path.split("."):
        fields = getattr(message, "get_fields_and_field_types", dict)()
        if name not in fields:
            raise FieldError(f"there is no field {path}; expected one of {', '.join(fields) or 'none'}")
        message = getattr(message, name)
    return message


def amount(message, path):
    """Returns the value of a field that is a number, or the seconds of a duration."""
    value = member(message, path)
    if hasattr(value, "nanosec"):
        return value.sec + value.nanosec / 1e9
    if not isinstance(value, (int, float)):
        raise FieldError(f"{path}: expected a number or a duration")
    return float(value)


def substitute(text, message):
    """Replaces `{field}` by the values of fields. Floats have two decimals."""

    def found(match):
        value = member(message, match[1])
        return f"{value:.2f}" if isinstance(value, float) else str(value)

    return FIELD.sub(found, text)


def fill(message, values, now=None):
    """Sets the fields of a message, and of the messages in it; `now` is the message for times that are `now`. Without it,
    this is a trial: texts with placeholders are skipped."""
    if not isinstance(values, dict):
        raise FieldError(f"expected fields of {type(message).__name__}, found {values!r}")
    types = message.get_fields_and_field_types()
    if types.keys() >= {"position", "orientation"} and values.keys() & {"x", "y", "z", "yaw"}:
        values = pose(values)
    for name, value in values.items():
        if name not in types:
            raise FieldError(f"{type(message).__name__} has no field {name}; expected one of {', '.join(types)}")
        if now is None and isinstance(value, str) and ("{" in value or value == "now"):
            continue
        try:
            setattr(message, name, convert(getattr(message, name), value, types[name], now))
        except FieldError as error:
            raise FieldError(f"{name}: {error}") from None
        except (AssertionError, TypeError, ValueError, OverflowError):
            raise FieldError(f"{name}: expected {types[name]}, found {value!r}") from None
    return message


def convert(present, value, kind, now):
    """Converts a value of the mapping to the type of a field."""
    if kind == "builtin_interfaces/Time" and value == "now":
        return now
    if hasattr(present, "get_fields_and_field_types"):
        return fill(present, value, now)
    if kind.startswith("sequence<") or kind.endswith("]"):
        if not isinstance(value, list):
            raise TypeError
        element = re.sub(r"^sequence<([^,>]+).*$", r"\1", kind).partition("[")[0]
        return [convert_element(element, it, now) for it in value]
    if isinstance(present, bool):
        texts = {"true": True, "false": False}
        return texts[value.lower()] if isinstance(value, str) and value.lower() in texts else checked(bool, value)
    if isinstance(present, int):
        return int(value) if isinstance(value, str) else checked(int, value)
    if isinstance(present, float):
        return float(value)
    return str(value) if isinstance(present, str) else value


def checked(kind, value):
    if type(value) is not kind:
        raise TypeError
    return value


def convert_element(kind, value, now):
    if "/" in kind:
        package, _, name = kind.partition("/")
        return fill(getattr(importlib.import_module(f"{package}.msg"), name)(), value, now)
    samples = {"boolean": False, "string": "", "wstring": "", "float": 0.0, "double": 0.0}
    return convert(samples.get(kind, 0), value, kind, now)


def pose(values):
    """Returns the fields of a `geometry_msgs/Pose` for `{x, y, z, yaw}`; `yaw` is in radians."""
    unknown = values.keys() - {"x", "y", "z", "yaw"}
    if unknown:
        raise FieldError(f"a pose has x, y, z and yaw, or position and orientation; found {', '.join(sorted(unknown))}")
    try:
        x, y, z, yaw = (float(values.get(name, 0)) for name in ("x", "y", "z", "yaw"))
    except (TypeError, ValueError):
        raise FieldError(f"expected numbers, found {values}") from None
    turn = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": z}, "orientation": turn}
