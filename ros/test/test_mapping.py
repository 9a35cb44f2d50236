"""Tests of the mapping file, and of logs from recordings, without ROS. `python3 -m unittest discover -s ros/test`"""

import importlib.util
import json
import os
import sys
import types
import unittest

PACKAGE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "elbowroom_ros")
HAS_YAML = importlib.util.find_spec("yaml") is not None
sys.path.insert(0, PACKAGE)


def message(name, **fields):
    """Returns a class like those of ROS for messages. Each field has its type and its default value."""

    def begin(self, **values):
        for field, (_, default) in fields.items():
            setattr(self, field, values.get(field, default() if isinstance(default, type) else default))

    kinds = {field: kind for field, (kind, _) in fields.items()}
    return type(name, (), {"__init__": begin, "get_fields_and_field_types": lambda self: dict(kinds)})


Time = message("Time", sec=("int32", 0), nanosec=("uint32", 0))
Header = message("Header", stamp=("builtin_interfaces/Time", Time), frame_id=("string", ""))
Point = message("Point", x=("double", 0.0), y=("double", 0.0), z=("double", 0.0))
Turn = message("Quaternion", x=("double", 0.0), y=("double", 0.0), z=("double", 0.0), w=("double", 1.0))
Pose = message("Pose", position=("geometry_msgs/Point", Point), orientation=("geometry_msgs/Quaternion", Turn))
Stamped = message("PoseStamped", header=("std_msgs/Header", Header), pose=("geometry_msgs/Pose", Pose))


class Drive:
    """An action like Nav2's."""

    Goal = message(
        "Drive_Goal", pose=("geometry_msgs/PoseStamped", Stamped), speed=("float", 0.0), tries=("uint8", 0),
        is_careful=("boolean", False), tags=("sequence<string>", None),
    )  # fmt: skip
    Result = message("Drive_Result", error_code=("uint16", 0), error_msg=("string", ""), used=("float", 0.0))
    Feedback = message("Drive_Feedback", left=("float", 0.0), time=("builtin_interfaces/Duration", Time))


class Action:
    def __init__(self, text, duration=3.0):
        self.text, self.duration = text, duration
        self.name, *self.arguments = text.strip("()").split()


DOCUMENT = """
tables:
  places:
    Lab: {x: 4.5, y: 1, yaw: 3.141592653589793}
  names: {r-1: robot_1}
actions:
  move:
    parameters: [robot, from, to]
    server: /{names[robot]}/drive
    type: fake_msgs/action/Drive
    goal:
      pose: {header: {frame_id: map, stamp: now}, pose: "{places[to]}"}
      speed: "{duration}"
      is_careful: true
      tags: ["{from}", to]
    success: {error_code: [0, 9]}
    measured: {"(charge {robot})": used}
    after_failure: {"(at {robot} {from})": true}
    feedback: {remaining: left, note: "{left} m"}
"""


@unittest.skipUnless(HAS_YAML, "the package yaml is not installed")
class MappingTest(unittest.TestCase):
    def setUp(self):
        interfaces = types.ModuleType("fake_msgs.action")
        interfaces.Drive = Drive
        sys.modules.update({"fake_msgs": types.ModuleType("fake_msgs"), "fake_msgs.action": interfaces})

    def read(self, text=DOCUMENT):
        import yaml
        from elbowroom_ros.mapping import Mapping

        return Mapping(yaml.safe_load(text))

    def move(self, text=DOCUMENT):
        move = self.read(text).actions["move"]
        return move, move.bind(Action("(move r-1 dock lab)"))

    def mistake(self, right, wrong):
        """Returns the message for a document with a mistake."""
        from elbowroom_ros.mapping import MappingError

        self.assertIn(right, DOCUMENT)
        with self.assertRaises(MappingError) as caught:
            self.read(DOCUMENT.replace(right, wrong)).actions["move"].action_type()
        return str(caught.exception)

    def test_goal_is_filled(self):
        move, bindings = self.move()
        self.assertIs(move.action_type(), Drive)
        goal, now = Drive.Goal(), Time(sec=7)
        move.fill_goal(goal, bindings, now)
        pose = goal.pose.pose
        self.assertEqual((pose.position.x, pose.position.y, round(pose.orientation.z, 9)), (4.5, 1.0, 1.0))
        self.assertEqual((goal.pose.header.frame_id, goal.pose.header.stamp), ("map", now))
        self.assertEqual((goal.speed, goal.is_careful, goal.tags), (3.0, True, ["dock", "to"]))
        self.assertEqual(move.resolve(move.server, bindings), "/robot_1/drive")
        self.assertEqual(move.facts_after_failure(bindings), {"(at r-1 dock)": True})

    def test_missing_row_is_named(self):
        from elbowroom_ros.mapping import MappingError

        move = self.read().actions["move"]
        with self.assertRaisesRegex(MappingError, "the table places of the mapping has no row moon"):
            move.fill_goal(Drive.Goal(), move.bind(Action("(move r-1 lab moon)")), Time())
        with self.assertRaisesRegex(MappingError, "has 1 arguments"):
            move.bind(Action("(move r-1)"))

    def test_result_decides(self):
        move, bindings = self.move()
        self.assertIsNone(move.failure_of(Drive.Result(error_code=9)))
        why = move.failure_of(Drive.Result(error_code=2, error_msg="lost"))
        self.assertEqual(why, "error_code is 2, expected [0, 9]; error_code 2, error_msg lost")
        self.assertEqual(move.measured_changes(Drive.Result(used=1.5), bindings), {"(charge r-1)": 1.5})
        move, _ = self.move(DOCUMENT.replace("    success:", '    failure: "code {error_code}"\n    success:'))
        self.assertEqual(move.reason(Drive.Result(error_code=2)), "code 2")

    def test_completion_is_the_share_of_the_first_remaining_amount(self):
        move, _ = self.move()
        first, seen = None, []
        for left in (0.0, 8.0, 6.0, 0.0, float("nan")):
            completion, note, first = move.progress(Drive.Feedback(left=left), first)
            seen.append(completion)
        self.assertEqual(seen, [None, 0.0, 0.25, 1.0, None])
        self.assertEqual(note, "nan m")
        move, _ = self.move(DOCUMENT.replace("remaining: left", "completion: time, full: 10"))
        self.assertEqual(move.progress(Drive.Feedback(time=Time(sec=2, nanosec=500_000_000)), None)[0], 0.25)

    def test_mistakes_are_named(self):
        cases = [
            ("server:", "serve:", "actions.move: unknown serve"),
            ("fake_msgs/action/Drive", "fake_msgs/action/Fly", "expected an installed interface"),
            ("frame_id: map", "frame: map", "Header has no field frame"),
            ("is_careful: true", "is_careful: 1", "is_careful: expected boolean, found 1"),
            ("is_careful: true", "tries: 1.5", "tries: expected uint8, found 1.5"),
            ('tags: ["{from}", to]', "tags: all", "tags: expected sequence<string>, found 'all'"),
            ("{places[to]}", "{rooms[to]}", "there is no table rooms"),
            ("{places[to]}", "{places[there]}", "{places[there]}: there is no parameter"),
            ("{duration}", "{span}", "span is no parameter; parameters: robot, from, to"),
            ("error_code: [0, 9]", "code: 0", "there is no field code"),
            ("remaining: left", "remaining: time.sec.x", "there is no field time.sec.x"),
            ("remaining: left", "completion: left, full: 0", "feedback.full: expected a number above 0, found 0"),
            ("{left} m", "{right} m", "there is no field right"),
            ("(charge {robot})\": used", "(charge {robot})\": error_msg", "error_msg: expected a number or a duration"),
            ("(at {robot} {from})\": true", "(at {robot} {from})\": 1", "expected facts with true or false"),
        ]
        for right, wrong, why in cases:
            self.assertIn(why, self.mistake(right, wrong))


def line(number, **entry):
    return number, json.dumps(entry)


def command(number, ticket, now, duration):
    start = {"type": "start", "ticket": ticket, "action": f"(move r{ticket} a b)", "duration": duration}
    return line(number, event="command", now={"decimal": now}, command=start)


def observed(number, now, **seen):
    return line(number, event="observed", now={"decimal": now}, observation={"time": {"decimal": now}, **seen})


class RecordingTest(unittest.TestCase):
    def setUp(self):
        from elbowroom_ros.bag_to_trace import Runs, attempts_of

        self.runs, self.attempts_of = Runs(), attempts_of

    def add(self, *lines):
        for it in lines:
            self.runs.add(*it)

    def traces(self):
        return [(len(lines), is_complete) for lines, is_complete in self.runs.traces()]

    def test_repeated_lines_count_once(self):
        self.add((1, "head"), (2, "a"), (2, "a"), (1, "head"), (2, "a"), (3, "b"))
        self.assertEqual(self.traces(), [(3, True)])

    def test_run_with_the_same_header_is_another_one(self):
        self.add((1, "head"), (2, "a"), (3, "b"), (1, "head"), (2, "a"), (3, "c"), (4, "d"))
        self.assertEqual(self.traces(), [(3, True), (4, True)])

    def test_header_may_be_on_its_own_topic(self):
        self.runs.headers.append("head")
        self.add((2, "a"), (3, "b"))
        self.assertEqual(self.traces(), [(3, True)])

    def test_missing_lines_are_noticed(self):
        self.add((1, "head"), (3, "b"))
        self.assertEqual(self.traces(), [(2, False)])

    def test_attempts_have_start_end_and_outcome(self):
        lines = [
            observed(1, 0.5, type="ended", ticket=9, outcome="succeeded"),
            command(2, 1, 1.0, {"decimal": 3.0}),
            observed(3, 1.25, type="started", ticket=1),
            command(4, 2, 2.0, None),
            observed(5, 2.5, type="started", ticket=2),
            command(6, 3, 2.5, {"decimal": 3.0}),
            observed(7, 4.0, type="ended", ticket=1, outcome="failed"),
            command(8, 4, 5.0, {"decimal": 3.0}),
            observed(9, 6.0, type="ended", ticket=4, outcome="succeeded"),
        ]
        rows = self.attempts_of([text for _, text in lines])
        found = [(it["action"], it["commanded"], it["start"], it["end"], it["outcome"], it["planned"]) for it in rows]
        self.assertEqual(found, [
            ("(move r2 a b)", 2.0, 2.5, 2.5, "succeeded", None),
            ("(move r1 a b)", 1.0, 1.25, 4.0, "failed", 3.0),
            ("(move r4 a b)", 5.0, 5.0, 6.0, "succeeded", 3.0),
            ("(move r3 a b)", 2.5, None, 6.0, "running", 3.0),
        ])  # fmt: skip


if __name__ == "__main__":
    unittest.main()
