"""Tests of `rosplan_world.py` with fake action interfaces: `python3 -m unittest discover -s examples`"""

import unittest
from types import SimpleNamespace

from rosplan_world import Dispatcher, kind, parameters
from test_plansys2_world import Asked

DOMAIN = """(define (domain d) ; (:action commented :parameters (?x))
  (:durative-action MOVE :parameters (?r - robot ?from ?to - place) :duration (= ?duration 5))
  (:action beep
    :parameters () :effect (done)))"""
NUMBERS = {
    "ACTION_PRECONDITION_FALSE": 0,
    "ACTION_ENABLED": 1,
    "ACTION_DISPATCHED_TO_GOAL_STATE": 1,
    "ACTION_SUCCEEDED_TO_GOAL_STATE": 2,
    "ACTION_DISPATCHED_TO_START_STATE": 3,
    "ACTION_FAILED": 10,
}


class Interfaces(unittest.TestCase):
    def setUp(self):
        self.sent = []
        self.names = parameters(DOMAIN)

    def begin(self, number, *arguments, constants=None, **named):
        if not hasattr(self, "dispatcher"):
            self.dispatcher = Dispatcher(lambda *sent: self.sent.append(sent), self.names, constants)
        action = Asked(*arguments, **named)
        action.ticket = number
        self.dispatcher.begin(action)
        return action

    def says(self, number, status, **information):
        pairs = [SimpleNamespace(key=key, value=value) for key, value in information.items()]
        self.dispatcher.feedback(SimpleNamespace(action_id=number, status=status, information=pairs))

    def test_parameters_have_the_names_of_the_domain(self):
        self.assertEqual(self.names, {"move": ["r", "from", "to"], "beep": []})
        self.begin(7)
        self.assertEqual(self.sent, [(7, "move", [("r", "r"), ("from", "a"), ("to", "b")], 5.0)])

    def test_texts_and_numbers_are_understood(self):
        for constants, words in ((None, ("action enabled", "action achieved")), (NUMBERS, (1, 2))):
            self.__dict__.pop("dispatcher", None)
            action = self.begin(7, constants=constants)
            for word in words:
                self.says(7, word)
            self.assertEqual(action.told, ["started", "succeeded"])

    def test_each_number_means_what_one_of_its_names_says(self):
        meant = {number: kind(number, NUMBERS) for number in NUMBERS.values()}
        self.assertEqual(meant, {0: "failed", 1: "started", 2: "succeeded", 3: None, 10: "failed"})

    def test_the_last_word_of_an_earlier_run_counts_for_nothing(self):
        self.dispatcher = Dispatcher(lambda *sent: self.sent.append(sent), self.names, first=5000)
        action = self.begin(7)
        self.assertEqual(self.sent[0][0], 5007)
        self.says(4007, "action achieved")
        self.says(7, "action achieved")
        self.assertEqual(action.told, [])
        self.says(5007, "action achieved")
        self.assertEqual(action.told, ["succeeded"])

    def test_two_actions_at_once_do_not_mix(self):
        first, second = self.begin(1), self.begin(2)
        self.says(2, "action enabled")
        self.says(2, "action achieved")
        self.says(1, "action enabled")
        self.assertEqual((first.told, second.told), (["started"], ["started", "succeeded"]))

    def test_a_failure_has_its_reason_and_what_is_repeated_counts_once(self):
        action = self.begin(1)
        self.says(1, "action failed", reason="the wheels slip")
        self.says(1, "action achieved")
        self.assertEqual(action.told, ["failed: reason: the wheels slip"])

    def test_an_action_that_the_domain_does_not_have_is_not_dispatched(self):
        action = self.begin(1, "fly", ["r"])
        self.assertEqual(action.told, ["failed: the domain has no action fly with 1 parameters"])
        self.assertEqual(self.sent, [])

    def test_an_instantaneous_action_has_started_when_it_is_achieved(self):
        action = self.begin(1, "beep", [], duration=None)
        self.says(1, "action enabled")
        self.says(1, "action achieved")
        self.assertEqual(action.told, ["started"])


if __name__ == "__main__":
    unittest.main()
