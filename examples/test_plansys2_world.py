"""Tests of `plansys2_world.py` with correct and faulty performers: `python3 -m unittest discover -s examples`"""

import unittest
from types import SimpleNamespace

from plansys2_world import (
    CANCEL, CONFIRM, FAILURE, FEEDBACK, FINISH, READY, REJECT, REQUEST, RESPONSE, RUNNING, Claim, Hub,
)  # fmt: skip


class Asked:
    """An action that Elbowroom has started, and the reports about it."""

    def __init__(self, name="move", arguments=("r", "a", "b"), duration=5.0):
        self.name, self.arguments, self.duration = name, list(arguments), duration
        self.told = []

    def started(self):
        self.told.append("started")

    def feedback(self, completion, note):
        self.told.append((completion, note))

    def succeeded(self):
        self.told.append("succeeded")

    def failed(self, why):
        self.told.append(f"failed: {why}")

    def was_cancelled(self):
        self.told.append("cancelled")


class Performers(unittest.TestCase):
    def setUp(self):
        self.now, self.sent = 0.0, []
        self.hub = Hub(lambda *message: self.sent.append(message), lambda: self.now)

    def begin(self, *arguments, **named):
        action = Asked(*arguments, **named)
        self.hub.begin(action)
        return action

    def says(self, kind, node="robot1", name="move", arguments=("r", "a", "b"), **more):
        fields = {"success": False, "completion": 0.0, "status": "", **more}
        message = {"type": kind, "node_id": node, "action": name, "arguments": list(arguments)}
        self.hub.message(SimpleNamespace(**message, **fields))

    def is_in(self, state, node="robot1"):
        self.hub.status(SimpleNamespace(node_name=node, state=state))

    def after(self, seconds, alive=None):
        """Advances the clock, with a status message each second."""
        for _ in range(int(seconds * 5)):
            self.now += 0.2
            if alive is not None and round(self.now * 5) % 5 == 0:
                self.is_in(alive)
            self.hub.tick()

    def kinds(self):
        return [(kind, node) for kind, node, _, _ in self.sent]

    def test_a_conversation(self):
        action = self.begin()
        self.assertEqual(self.sent, [(REQUEST, "elbowroom", "move", ["r", "a", "b"])])
        self.says(RESPONSE)
        self.says(FEEDBACK, completion=0.5, status="half-way")
        self.says(FINISH, success=True, completion=1.0)
        self.assertEqual(action.told, ["started", (0.5, "half-way"), "succeeded"])
        self.assertEqual(self.kinds(), [(REQUEST, "elbowroom"), (CONFIRM, "robot1")])

    def test_a_request_that_is_lost_is_repeated(self):
        action = self.begin()
        self.after(2.5)
        self.assertEqual(self.kinds(), 3 * [(REQUEST, "elbowroom")])
        self.says(RESPONSE)
        self.after(2, alive=RUNNING)
        self.assertEqual(self.kinds()[3:], [(CONFIRM, "robot1")])
        self.assertEqual(action.told, ["started"])

    def test_two_actions_at_once_do_not_mix(self):
        move, wait = self.begin(), self.begin("wait", ["s"])
        self.says(RESPONSE, node="robot2", name="wait", arguments=["s"])
        self.says(RESPONSE)
        self.says(FINISH, node="robot2", name="wait", arguments=["s"], success=True)
        self.assertEqual((move.told, wait.told), (["started"], ["started", "succeeded"]))

    def test_the_second_of_two_robots_is_rejected_also_when_it_comes_late(self):
        self.begin()
        self.says(RESPONSE, node="robot1")
        self.says(RESPONSE, node="robot2")
        self.says(FINISH, success=True)
        self.says(RESPONSE, node="robot3")
        rejected = [node for kind, node in self.kinds() if kind == REJECT]
        self.assertEqual(rejected, ["robot2", "robot3"])

    def test_what_the_rejected_one_says_does_not_count(self):
        action = self.begin()
        self.says(RESPONSE, node="robot1")
        self.says(FINISH, node="robot2", success=True)
        self.assertEqual(action.told, ["started"])

    def test_nobody_answers(self):
        action = self.begin()
        self.is_in(READY, node="gripper")
        self.after(31, alive=None)
        self.assertEqual(len(action.told), 1)
        self.assertIn("no performer answered within 30 s", action.told[0])
        self.says(RESPONSE)
        self.assertEqual(self.kinds()[-1], (REJECT, "robot1"))

    def test_a_performer_that_falls_silent_is_named(self):
        action = self.begin()
        self.says(RESPONSE)
        self.after(20, alive=RUNNING)
        self.assertEqual(action.told, ["started"])
        self.after(6)
        self.assertEqual(action.told[1:], ["failed: robot1 is lost: no message from it for 5 s"])
        self.assertEqual(self.kinds()[-1], (CANCEL, "robot1"))
        self.says(FINISH, success=True)
        self.assertEqual(len(action.told), 2)

    def test_a_performer_that_does_nothing_has_lost_a_word(self):
        action = self.begin()
        self.says(RESPONSE)
        self.after(2, alive=READY)
        self.after(1, alive=RUNNING)
        self.after(3, alive=READY)
        self.assertEqual(action.told, ["started"])
        self.after(1, alive=READY)
        self.assertEqual(action.told[1:], ["failed: robot1 is idle, and has not reported the outcome"])
        self.assertEqual(self.kinds()[-1], (CANCEL, "robot1"))

    def test_a_failure_has_its_reason(self):
        action, other = self.begin(), self.begin("wait", ["s"])
        self.says(RESPONSE)
        self.says(FINISH, success=False, status="the wheels slip")
        self.assertEqual(action.told, ["started", "failed: the wheels slip"])
        self.says(RESPONSE, node="robot2", name="wait", arguments=["s"])
        self.is_in(FAILURE, node="robot2")
        self.assertEqual(other.told, ["started", "failed: robot2 reports a failure"])

    def test_a_repeated_finish_counts_once(self):
        action = self.begin()
        self.says(RESPONSE)
        self.says(FINISH, success=True)
        self.says(FINISH, success=False)
        self.assertEqual(action.told, ["started", "succeeded"])

    def test_a_cancel_counts_when_the_performer_is_ready_again(self):
        action = self.begin()
        self.says(RESPONSE)
        self.hub.cancel(action)
        self.hub.cancel(action)
        self.assertEqual(self.kinds()[2:], [(CANCEL, "robot1")])
        self.is_in(RUNNING)
        self.assertEqual(action.told, ["started"])
        again = self.begin()
        self.assertIn("has not confirmed that it has stopped", again.told[0])
        self.is_in(READY)
        self.assertEqual(action.told, ["started", "cancelled"])
        self.says(RESPONSE, node=self.begin() and "robot1")
        self.assertEqual(self.kinds()[-1], (CONFIRM, "robot1"))

    def test_what_nobody_does_yet_is_cancelled_at_once(self):
        action = self.begin()
        self.hub.cancel(action)
        self.assertEqual(action.told, ["cancelled"])
        self.says(RESPONSE)
        self.assertEqual(self.kinds()[-1], (REJECT, "robot1"))

    def test_a_success_after_a_cancel_counts(self):
        action = self.begin()
        self.says(RESPONSE)
        self.hub.cancel(action)
        self.says(FINISH, success=True)
        self.assertEqual(action.told, ["started", "succeeded"])

    def test_the_same_action_is_not_done_twice_at_a_time(self):
        self.begin()
        self.says(RESPONSE)
        again = self.begin()
        self.assertEqual(again.told, ["failed: robot1 is still busy with the same action"])

    def test_an_action_without_arguments_is_its_own_argument(self):
        for arguments in ([], ["beep"]):
            action = self.begin("beep", [], duration=None)
            self.says(RESPONSE, name="beep", arguments=arguments)
            self.says(FINISH, name="beep", arguments=arguments, success=True)
            self.assertEqual(action.told, ["started"])


class Claims(unittest.TestCase):
    def setUp(self):
        self.now, self.texts = 0.0, []
        self.first = Claim(self.texts.append, lambda: self.now)
        self.second = Claim(lambda _: None, lambda: self.now)

    def test_second_executor_gives_way_to_a_holder(self):
        self.first.hold()
        self.second.check(self.texts[-1])
        self.assertIn("another executor, process", self.second.refusal)

    def test_released_claim_is_ignored(self):
        self.first.hold()
        self.now = 10.0
        self.first.release()
        self.first.tick()
        self.assertTrue(self.texts[-1].startswith("released "), self.texts)
        self.second.check(self.texts[-1])
        self.assertIsNone(self.second.refusal)


if __name__ == "__main__":
    unittest.main()
