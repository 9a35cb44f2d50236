"""Mapping of the actions of a domain to ROS 2 action servers: a YAML file. docs/reference/ros2.md has the format."""

import importlib
import math
import re

import yaml

from .fields import FieldError, amount, fill, member, substitute

PLACEHOLDER = re.compile(r"\{(\w+)(?:\[(\w+)\])?\}")


class MappingError(Exception):
    """The file is not a valid mapping, or an action does not fit it."""


class Mapping:
    """The contents of a mapping file."""

    def __init__(self, document):
        document = section("the file", document, {"tables", "actions", "wait_for"})
        self.tables = {}
        for name, rows in section("tables", document.get("tables", {})).items():
            rows = section(f"tables.{name}", rows)
            self.tables[name] = {str(key).lower(): value for key, value in rows.items()}
        wait = section("wait_for", document.get("wait_for", {}), {"servers", "seconds"})
        self.servers = wait.get("servers", [])
        if not is_list_of_texts(self.servers):
            raise MappingError("wait_for.servers: expected a list of names")
        self.seconds = number("wait_for.seconds", wait.get("seconds", 10))
        actions = section("actions", document.get("actions", {}))
        if not actions:
            raise MappingError("actions: expected at least one action")
        self.actions = {name.lower(): ActionMapping(name, it, self.tables) for name, it in actions.items()}

    @classmethod
    def read(cls, path):
        """Reads a file."""
        try:
            with open(path, encoding="utf-8") as file:
                return cls(yaml.safe_load(file))
        except (OSError, UnicodeDecodeError, yaml.YAMLError, MappingError) as error:
            raise MappingError(f"{path}: {error}") from None


class ActionMapping:
    """The action server for one action of the domain."""

    KEYS = {"parameters", "server", "type", "goal", "success", "failure", "after_failure", "measured", "feedback"}

    def __init__(self, name, document, tables):
        self.place, self.tables = f"actions.{name}", tables
        document = section(self.place, document, self.KEYS)
        self.server, self.type = (self._text(document, key) for key in ("server", "type"))
        self.parameters = document.get("parameters", [])
        if not is_list_of_texts(self.parameters):
            raise MappingError(f"{self.place}.parameters: expected a list of names")
        self.goal, self.success, self.measured, self.after_failure = (
            section(f"{self.place}.{key}", document.get(key, {}))
            for key in ("goal", "success", "measured", "after_failure")
        )
        for fact, value in self.after_failure.items():
            if not isinstance(fact, str) or not isinstance(value, bool):
                raise MappingError(f"{self.place}.after_failure: expected facts with true or false, found {fact}: {value}")
        self.failure = self._text(document, "failure") if "failure" in document else None
        keys = {"completion", "full", "remaining", "note"}
        self.feedback = section(f"{self.place}.feedback", document.get("feedback", {}), keys)
        self.full = number(f"{self.place}.feedback.full", self.feedback.get("full", 1))
        for part in (self.server, self.goal, list(self.measured), list(self.after_failure)):
            self._check_placeholders(part)

    def _text(self, document, key):
        if not isinstance(document.get(key), str):
            raise MappingError(f"{self.place}.{key}: expected a text")
        return document[key]

    def _check_placeholders(self, value):
        for name, key in placeholders(value):
            text = f"{{{name}[{key}]}}" if key else f"{{{name}}}"
            if key and name not in self.tables:
                raise MappingError(f"{self.place}: {text}: there is no table {name}")
            if (key or name) not in [*self.parameters, *([] if key else ["duration"])]:
                known = ", ".join(self.parameters) or "none"
                raise MappingError(f"{self.place}: {text}: {key or name} is no parameter; parameters: {known}")

    def action_type(self):
        """Returns the class of the interface, after a check of all names of fields in the mapping."""
        package, _, name = self.type.rpartition("/")
        try:
            found = getattr(importlib.import_module(package.replace("/", ".")), name)
            goal, result, feedback = found.Goal(), found.Result(), found.Feedback()
        except (ImportError, AttributeError, ValueError) as error:
            why = "expected an installed interface of an action, such as nav2_msgs/action/NavigateToPose"
            raise MappingError(f"{self.place}.type: {self.type}: {why} ({error})") from None
        used = self.feedback
        parts = [
            ("goal", lambda: fill(goal, self.goal)),
            ("success", lambda: [member(result, it) for it in self.success]),
            ("failure", lambda: substitute(self.failure or "", result)),
            ("measured", lambda: [amount(result, it) for it in self.measured.values()]),
            ("feedback", lambda: [amount(feedback, used[it]) for it in ("completion", "remaining") if it in used]),
            ("feedback.note", lambda: substitute(used.get("note", ""), feedback)),
        ]
        for part, check in parts:
            try:
                check()
            except FieldError as error:
                raise MappingError(f"{self.place}.{part}: {error}") from None
        return found

    def fill_goal(self, goal, bindings, now):
        """Sets the fields of the goal for an action; `now` is the present time as a message."""
        return fill(goal, self.resolve(self.goal, bindings), now)

    def bind(self, action):
        """Returns the values of the parameters for an action of the plan."""
        count = len(action.arguments)
        if count != len(self.parameters):
            raise MappingError(f"{self.place}.parameters: {action.text} has {count} arguments")
        return {"duration": action.duration or 0.0, **dict(zip(self.parameters, action.arguments))}

    def resolve(self, value, bindings):
        """Replaces placeholders: `{to}` by an argument, `{places[to]}` by the row of a table. A text that is one placeholder
        becomes the whole row."""
        if isinstance(value, dict):
            return {key: self.resolve(it, bindings) for key, it in value.items()}
        if isinstance(value, list):
            return [self.resolve(it, bindings) for it in value]
        if not isinstance(value, str):
            return value

        def found(match):
            name, key = match.groups()
            if key is None:
                return bindings[name]
            row = str(bindings[key]).lower()
            if row not in self.tables[name]:
                raise MappingError(f"the table {name} of the mapping has no row {bindings[key]}")
            return self.tables[name][row]

        whole = PLACEHOLDER.fullmatch(value)
        return found(whole) if whole else PLACEHOLDER.sub(lambda it: str(found(it)), value)

    def failure_of(self, result):
        """Returns the reason why the result of a goal is none of success, or `None`."""
        for field, expected in self.success.items():
            value = member(result, field)
            if value not in (expected if isinstance(expected, list) else [expected]):
                return f"{field} is {value}, expected {expected}; {self.reason(result)}"
        return None

    def reason(self, result):
        """Returns the text for a result: that of the mapping, or all plain fields that are set."""
        if self.failure is not None:
            return substitute(self.failure, result)
        fields = {name: getattr(result, name) for name in result.get_fields_and_field_types()}
        plain = {name: value for name, value in fields.items() if isinstance(value, (str, int, float)) and value}
        return ", ".join(f"{name} {value}" for name, value in plain.items()) or "without a reason"

    def facts_after_failure(self, bindings):
        """Returns the facts that are reported after a failure or a cancellation, with their values."""
        return {self.resolve(fact, bindings): value for fact, value in self.after_failure.items()}

    def measured_changes(self, result, bindings):
        """Returns the measured changes of fluents."""
        changes = self.measured.items()
        return {self.resolve(fluent, bindings): amount(result, field) for fluent, field in changes}

    def progress(self, feedback, first):
        """Returns the completion, or `None`, the note, and the first remaining amount, of which the completion is a
        share."""
        completion = None
        if "completion" in self.feedback:
            completion = amount(feedback, self.feedback["completion"]) / self.full
        elif "remaining" in self.feedback:
            left = amount(feedback, self.feedback["remaining"])
            # Nav2 reports 0 until it has a path.
            first = left if first is None and left > 0 else first
            completion = None if first is None else 1 - left / first
        if completion is not None and not math.isfinite(completion):
            completion = None
        return completion, substitute(self.feedback.get("note", ""), feedback), first


def placeholders(value):
    """Returns the placeholders in a value, each with the parameter that selects a row, or `None`."""
    if isinstance(value, dict):
        return placeholders([*value, *value.values()])
    if isinstance(value, list):
        return [it for part in value for it in placeholders(part)]
    return [it.groups() for it in PLACEHOLDER.finditer(value)] if isinstance(value, str) else []


def section(place, value, keys=None):
    """Checks that a value has members, and only known ones."""
    if not isinstance(value, dict):
        raise MappingError(f"{place}: expected members, found {value!r}")
    unknown = sorted(str(it) for it in value if keys is not None and it not in keys)
    if unknown:
        raise MappingError(f"{place}: unknown {', '.join(unknown)}; expected {', '.join(sorted(keys))}")
    return value


def number(place, value):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise MappingError(f"{place}: expected a number above 0, found {value!r}")
    return float(value)


def is_list_of_texts(value):
    return isinstance(value, list) and all(isinstance(it, str) for it in value)
