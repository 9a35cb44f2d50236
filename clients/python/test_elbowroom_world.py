"""Tests of the library's messages. `python3 -m unittest discover -s clients/python`"""

import io
import json
import os
import tempfile
import threading
import time
import unittest
from unittest import mock

from elbowroom_world import Failed, Simulation, Stepped, World


PIPES = []


def tearDownModule():
    for pipe in PIPES:
        pipe.close()


class Peer:
    """The other end of the protocol: Elbowroom's messages, line by line."""

    def __init__(self, world, version=2, resumed=None):
        self.world = world
        there, self._said = os.pipe(), os.pipe()
        self._mouth = os.fdopen(there[1], "w")
        self._ears = os.fdopen(self._said[0], encoding="utf-8")
        self._ends = (os.fdopen(there[0]), os.fdopen(self._said[1], "w"))
        PIPES.extend([self._mouth, self._ears, *self._ends])
        self._thread = threading.Thread(target=world.run, args=self._ends, daemon=True)
        self._thread.start()
        hello = {"type": "hello", "protocol": "elbowroom-world", "version": 1}
        if version == 2:
            hello["versions"] = [1, 2]
        if resumed is not None:
            hello["resumed"] = resumed
        self.tell(**hello)
        self.greeting = self.hear() if version == 2 else None
        self._question = 0

    def tell(self, **message):
        self._mouth.write(json.dumps(message) + "\n")
        self._mouth.flush()

    def hear(self):
        return json.loads(self._ears.readline())

    def start(self, ticket, action="(drive rover depot shelf)", duration=1.0):
        lasts = None if duration is None else {"exact": str(duration), "decimal": duration}
        self.tell(type="start", ticket=ticket, action=action, duration=lasts)

    def ask(self, **question):
        """Returns the reports up to `time`, and the present time."""
        self._question += 1
        self.tell(question=self._question, **question)
        reports = []
        while True:
            message = self.hear()
            if message["type"] == "time":
                return reports, message["now"]
            reports.append(message)

    def wait(self, until):
        return self.ask(type="wait", until={"exact": str(until), "decimal": until})

    def reports(self, enough):
        """Collects reports from several answers until there are enough, for at most half a minute."""
        reports, begun = [], time.monotonic()
        while len(reports) < enough and time.monotonic() - begun < 30:
            more, _ = self.wait(self.world.now() + 1)
            reports += more
        return reports

    def stop(self):
        self.tell(type="stop")
        self._thread.join(5)
        return not self._thread.is_alive()

    def hang_up(self):
        self._mouth.close()
        self._thread.join(5)
        return not self._thread.is_alive()


def kinds(reports):
    return [(it["type"], it.get("outcome")) for it in reports if it["type"] != "feedback"]


class ClockTest(unittest.TestCase):
    """A world whose time is that of a simulator."""

    def setUp(self):
        self.time = 1000.0
        self.world = World(clock=lambda: self.time)

    def test_time_is_that_of_the_clock(self):
        slept = []

        @self.world.action("drive")
        def drive(action):
            slept.append(action.sleep(5))

        peer = Peer(self.world)
        peer.start(0, duration=5.0)
        reports, now = peer.wait(10)
        self.assertEqual(([it["type"] for it in reports], now), (["started"], 0.0))
        answer = []
        asking = threading.Thread(target=lambda: answer.append(peer.wait(20)))
        asking.start()
        asking.join(0.2)
        self.assertEqual((answer, slept), ([], []), "the clock stands still")
        self.time += 6
        asking.join(30)
        ((reports, now),) = answer
        self.assertEqual(([it["outcome"] for it in reports], now, slept), (["succeeded"], 6.0, [True]))

    def test_wait_ends_at_its_time(self):
        peer = Peer(self.world)
        peer.wait(0)
        self.time += 3
        self.assertEqual(peer.wait(2.5), ([], 3.0))

    def test_cancelled_sleep_ends(self):
        slept = []
        self.world.action("drive")(lambda action: slept.append(action.sleep(5)))
        peer = Peer(self.world)
        peer.start(0, duration=5.0)
        peer.wait(1)
        peer.tell(type="cancel", ticket=0)
        self.assertEqual([it["outcome"] for it in peer.wait(1)[0]], ["cancelled"])
        self.assertEqual(slept, [False])


class OnTheWallClock(unittest.TestCase):
    def test_an_action_runs_beside_the_conversation_and_succeeds(self):
        world = World(speed=100)

        @world.action("drive")
        def drive(action):
            self.assertEqual(action.arguments, ["rover", "depot", "shelf"])
            action.feedback(0.5, "half-way")
            action.sleep(action.duration)

        peer = Peer(world)
        self.assertEqual(peer.greeting["version"], 2)
        self.assertIn("cancel", peer.greeting["can"])
        peer.start(0)
        reports = peer.reports(3)
        self.assertEqual(kinds(reports), [("started", None), ("ended", "succeeded")])
        half = [it for it in reports if it["type"] == "feedback"]
        self.assertEqual([(it["completion"], it["note"]) for it in half], [(0.5, "half-way")])
        took = reports[-1]["time"] - reports[0]["time"]
        self.assertGreaterEqual(took, 1.0)
        self.assertTrue(peer.stop())

    def test_a_wait_ends_at_its_time_when_nothing_happens(self):
        peer = Peer(World(speed=100))
        reports, now = peer.wait(3)
        self.assertEqual(reports, [])
        self.assertGreaterEqual(now, 3)

    def test_failures_and_slips_are_told_with_their_reason(self):
        world = World(speed=100)

        @world.action("drive")
        def drive(action):
            raise Failed("the wheels slip")

        @world.action("pick")
        def pick(action):
            return {}["gripper"]

        peer = Peer(world)
        peer.start(0)
        peer.start(1, "(pick rover parcel)")
        peer.start(2, "(fly rover)")
        reports = peer.reports(5)
        why = {it["ticket"]: it["why"] for it in reports if it["type"] == "ended"}
        self.assertEqual(why[0], "the wheels slip")
        self.assertEqual(why[1], "KeyError: 'gripper'")
        self.assertEqual(why[2], "this world has no action fly")

    def test_a_cancelled_action_stops_and_says_so_once(self):
        world = World(speed=10)

        @world.action("*")
        def work(action):
            if not action.sleep(1000):
                return

        peer = Peer(world)
        peer.start(0)
        self.assertEqual(kinds(peer.reports(1)), [("started", None)])
        peer.tell(type="cancel", ticket=0)
        peer.tell(type="cancel", ticket=0)
        self.assertEqual(kinds(peer.reports(1)), [("ended", "cancelled")])
        self.assertEqual(peer.wait(world.now() + 2)[0], [])

    def test_what_a_robot_calls_back_is_told_once_and_in_order(self):
        world, begun = World(speed=100), []
        world.starter("drive")(begun.append)
        world.canceller(lambda action: action.was_cancelled())
        peer = Peer(world)
        peer.start(0)
        peer.start(0)
        peer.wait(world.now() + 1)
        (action,) = begun
        action.succeeded()
        action.succeeded()
        action.failed("after all")
        self.assertEqual(kinds(peer.reports(2)), [("started", None), ("ended", "succeeded")])
        self.assertEqual(peer.wait(world.now() + 5)[0], [])
        peer.start(1)
        peer.wait(world.now() + 1)
        peer.tell(type="cancel", ticket=1)
        self.assertEqual(kinds(peer.reports(1)), [("ended", "cancelled")])

    def test_an_instantaneous_action_has_started_when_it_is_done(self):
        world = World(speed=100)
        world.action("beep")(lambda action: None)

        @world.action("burst")
        def burst(action):
            raise Failed("no air")

        peer = Peer(world)
        peer.start(0, "(beep)", None)
        self.assertEqual(kinds(peer.reports(1)), [("started", None)])
        peer.start(1, "(burst)", None)
        self.assertEqual(kinds(peer.reports(1)), [("ended", "failed")])

    def test_facts_and_values_are_pushed_and_looked_at(self):
        world = World(speed=10)
        world.look(lambda words: {"at": True, "charge": 17.5}.get(words[0]))
        peer = Peer(world)
        self.assertIn("look", peer.greeting["can"])
        threading.Timer(0.05, lambda: world.fact("(open door)", False)).start()
        ((report,), now) = peer.wait(1000)
        self.assertEqual((report["fact"], report["becomes"]), ("(open door)", False))
        self.assertLess(now, 900)
        seen, _ = peer.ask(type="look", facts=["(at r b)", "(lies p)"], fluents=["(charge r)"])
        self.assertEqual([it["type"] for it in seen], ["fact", "value"])
        self.assertEqual(seen[1]["value"], 17.5)

    def test_reports_can_have_the_time_of_another_clock(self):
        world = World("rover")

        @world.starter("drive")
        def drive(action):
            world.clock("arm", 1000.0, rate=2)
            action.started(stamp=("arm", 1000.5))
            world.value("(charge rover)", 7, stamp=("arm", 1001))
            world.fact("(open door)", True)
            action.failed("the wheels slip", stamp=("arm", 1002))

        peer = Peer(world)
        peer.start(0)
        reports = peer.reports(5)
        clock, started, value, fact, ended = reports
        self.assertEqual((clock["clock"], clock["reads"], clock["rate"]), ("arm", 1000.0, 2.0))
        times = [(it.get("clock"), it["time"]) for it in (started, value, ended)]
        self.assertEqual(times, [("arm", 1000.5), ("arm", 1001.0), ("arm", 1002.0)])
        self.assertNotIn("clock", fact)
        self.assertLess(fact["time"], 100)
        # A repeated report has the world's time.
        again, _ = peer.ask(type="look", facts=[], fluents=[], tickets=[0])
        self.assertEqual([it["type"] for it in again], ["ended"])
        self.assertNotIn("clock", again[0])
        self.assertLess(again[0]["time"], 100)
        self.assertNotIn("stamp", again[0])
        self.assertTrue(peer.stop())

    def test_in_version_1_there_is_one_clock(self):
        world = World("rover")

        @world.starter("drive")
        def drive(action):
            world.clock("arm", 1000.0)
            action.started(stamp=("arm", 1000.5))

        peer = Peer(world, version=1)
        peer.start(0)
        (started,) = peer.reports(1)
        self.assertEqual(started["type"], "started")
        self.assertNotIn("clock", started)
        self.assertLess(started["time"], 100)
        self.assertTrue(peer.stop())

    def test_what_is_believed_is_heard_by_who_wants_to(self):
        world, heard = World(), []
        world.believed(lambda facts, values: heard.append((facts, values)))
        peer = Peer(world)
        self.assertIn("beliefs", peer.greeting["can"])
        number = {"exact": "7/2", "decimal": 3.5}
        peer.tell(type="believed", now=number, facts={"(at r a)": True}, values={"(charge r)": number})
        peer.tell(type="believed", now=number, facts={}, values={"(charge r)": None})
        self.assertEqual(peer.ask(type="look", facts=[])[0], [])
        self.assertEqual(heard, [({"(at r a)": True}, {"(charge r)": 3.5}), ({}, {"(charge r)": None})])
        self.assertNotIn("beliefs", Peer(World()).greeting["can"])

    def test_without_an_offer_of_version_2_the_first_is_spoken(self):
        world = World(speed=100)

        @world.action("*")
        def work(action):
            action.feedback(0.5)

        peer = Peer(world, version=1)
        peer.start(0)
        reports = peer.reports(2)
        self.assertEqual([it["type"] for it in reports], ["started", "ended"])

    def test_when_elbowroom_is_gone_what_runs_is_told_to_stop(self):
        world, stopped = World(speed=1), threading.Event()

        @world.action("*")
        def work(action):
            if not action.sleep(1000):
                stopped.set()

        peer = Peer(world)
        peer.start(0)
        peer.wait(0.2)
        self.assertTrue(peer.hang_up())
        self.assertTrue(stopped.wait(5))

    def test_lines_that_are_no_messages_are_passed_over(self):
        world = World(speed=100)
        peer = Peer(world)
        peer._mouth.write("hello\n[]\n")
        peer.tell(type="from-a-later-version")
        self.assertEqual(peer.wait(1)[0], [])


class WhenTheSystemClockIsSet(unittest.TestCase):
    def test_time_is_monotonic(self):
        for offset in (-3600.0, 3600.0):
            world, wall = World(speed=100), time.time
            peer = Peer(world)
            peer.wait(1)
            with mock.patch("time.time", lambda: wall() + offset):
                before = world.now()
                reports, now = peer.wait(before + 1)
            self.assertEqual(reports, [])
            self.assertGreaterEqual(now, before + 1)
            self.assertLess(now, 100 * 1800)
            self.assertTrue(peer.stop())


class Simulated(unittest.TestCase):
    def test_time_jumps_to_the_next_end(self):
        world = Simulation()
        world.lasts("*")(lambda action: 2 * action.duration)
        world.fact_at(7, "(open door)", True)
        peer = Peer(world)
        peer.start(0, duration=5.0)
        self.assertEqual(peer.wait(100), ([{"type": "started", "ticket": 0, "time": 0.0}], 0.0))
        reports, now = peer.wait(100)
        self.assertEqual((reports[0]["type"], now), ("fact", 7))
        reports, now = peer.wait(100)
        self.assertEqual((reports[0]["outcome"], now), ("succeeded", 10))
        self.assertEqual(peer.wait(100), ([], 100))
        self.assertTrue(peer.stop())


class Depot(Stepped):
    """Each action takes twice its planned duration."""

    def __init__(self, **options):
        super().__init__(**options)
        self.left = {}

    def begin(self, action):
        if action.name == "fly":
            raise Failed("no wings")
        if action.duration is not None:
            self.left[action] = 2 * action.duration

    def step(self, dt):
        for action in list(self.left):
            self.left[action] -= dt
            if self.left[action] <= 1e-9:
                del self.left[action]
                action.succeeded()

    def cancel(self, action):
        del self.left[action]


class InSteps(unittest.TestCase):
    def test_simulator_advances_to_the_next_end(self):
        peer = Peer(Depot())
        peer.start(0, duration=1.0)
        self.assertEqual(peer.wait(100), ([{"type": "started", "ticket": 0, "time": 0.0}], 0.0))
        ((report,), now) = peer.wait(100)
        self.assertEqual(report["outcome"], "succeeded")
        self.assertAlmostEqual(report["time"], 2.0)
        self.assertAlmostEqual(now, 2.0)
        self.assertEqual(peer.wait(5), ([], 5))
        self.assertTrue(peer.stop())

    def test_refused_cancelled_and_instantaneous_actions(self):
        peer = Peer(Depot())
        peer.start(0, "(fly rover)")
        self.assertEqual(kinds(peer.wait(1)[0]), [("ended", "failed")])
        peer.start(1, "(beep)", None)
        self.assertEqual(kinds(peer.wait(1)[0]), [("started", None)])
        peer.start(2)
        self.assertEqual(kinds(peer.wait(1)[0]), [("started", None)])
        peer.tell(type="cancel", ticket=2)
        self.assertEqual(kinds(peer.wait(1)[0]), [("ended", "cancelled")])
        self.assertEqual(peer.world.left, {})
        self.assertEqual(peer.wait(10)[0], [])

    def test_running_actions_are_cancelled_at_the_end(self):
        peer = Peer(Depot(pace=100.0))
        peer.start(0, duration=50.0)
        peer.wait(3)
        self.assertTrue(peer.stop())
        self.assertEqual(peer.world.left, {})

    def test_steps_of_a_fixed_length_are_counted(self):
        class Fixed(Depot):
            def step(self, dt):
                super().step(0.25)
                return 0.25

        peer = Peer(Fixed())
        self.assertEqual(peer.wait(0.6), ([], 0.75))


class AfterACrash(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.ledger = os.path.join(self.folder.name, "ledger")

    def world(self, resumes):
        world, self.done = World(speed=100, ledger=self.ledger), []

        @world.action("drive", resumes=resumes)
        def drive(action):
            self.done.append((action.ticket, action.is_resumed))
            action.sleep(action.start + action.duration - world.now() if action.start else action.duration)

        return world

    def before(self):
        """One action has ended and one is running when both programs are killed."""
        peer = Peer(self.world(False))
        self.assertIn("resume", peer.greeting["can"])
        peer.start(0, duration=1.0)
        self.assertEqual(len(peer.reports(2)), 2)
        peer.start(1, duration=500.0)
        peer.reports(1)
        self.assertTrue(peer.hang_up())
        # The lock is also released at the end of the process.
        peer.world._ledger.release()
        with open(self.ledger, "a", encoding="utf-8") as file:
            file.write('{"ticket": 7, "act')  # cut off

    def resumed(self, resumes):
        peer = Peer(self.world(resumes), resumed={"now": 3})
        reports, _ = peer.ask(type="look", facts=[], fluents=[], tickets=[0, 1, 2])
        return {it["ticket"]: it for it in reports}, peer

    def test_it_says_what_became_of_what_was_started(self):
        self.before()
        told, _ = self.resumed(True)
        self.assertEqual((told[0]["type"], told[0]["outcome"]), ("ended", "succeeded"))
        self.assertEqual(told[1]["type"], "started")
        self.assertEqual(told[2]["type"], "unknown")
        self.assertEqual(self.done, [(1, True)])

    def test_what_cannot_be_resumed_has_failed(self):
        self.before()
        told, peer = self.resumed(False)
        if 1 in told and told[1]["type"] == "started":
            told = {it["ticket"]: it for it in peer.wait(1000)[0]}
        self.assertEqual((told[1]["type"], told[1]["outcome"]), ("ended", "failed"))

    def test_its_time_goes_on(self):
        self.before()
        time.sleep(0.1)
        _, peer = self.resumed(True)
        _, now = peer.wait(0)
        self.assertGreater(now, 10)

    def test_time_after_restart_is_not_before_the_ledger(self):
        self.before()
        wall = time.time
        with mock.patch("time.time", lambda: wall() - 3600):
            told, peer = self.resumed(True)
            _, now = peer.wait(0)
        self.assertGreaterEqual(now, told[1]["time"])
        self.assertLess(now, 100 * 1800)

    def test_nothing_is_started_twice(self):
        self.before()
        _, peer = self.resumed(True)
        peer.start(0)
        peer.start(1)
        time.sleep(0.05)
        self.assertEqual(self.done, [(1, True)])

    def test_remembered_text_survives_a_restart(self):
        world = World(ledger=self.ledger)
        world.starter("drive")(lambda action: (action.remember(f"job {action.ticket}"), action.started()))
        peer = Peer(world)
        for ticket in (0, 1):
            peer.start(ticket)
        peer.reports(2)
        self.assertTrue(peer.hang_up())
        world._ledger.release()
        resumed, found = World(ledger=self.ledger), []
        resumed.starter("drive", resumes=True)(lambda action: found.append((action.ticket, action.memory)))
        Peer(resumed, resumed={"now": 3}).ask(type="look", facts=[], fluents=[], tickets=[0, 1])
        self.assertEqual(found, [(0, "job 0"), (1, "job 1")])

    def test_other_clock_continues_after_a_restart(self):
        clock = {"now": 500.0}
        world = World(ledger=self.ledger, clock=lambda: clock["now"])
        world.starter("drive")(lambda action: action.started())
        peer = Peer(world)
        peer.start(0)
        peer.reports(1)
        self.assertTrue(peer.hang_up())
        world._ledger.release()
        clock["now"] = 530.0
        peer = Peer(World(ledger=self.ledger, clock=lambda: clock["now"]), resumed={"now": 3})
        self.assertEqual(peer.wait(0)[1], 30.0)

    def test_a_ledger_belongs_to_one_program_at_a_time(self):
        first = Peer(self.world(True))
        first.start(0, duration=500.0)
        first.reports(1)
        done, taken_over = self.done, []

        def take_over():
            taken_over.append(Peer(self.world(True), resumed={"now": 3}))

        second = threading.Thread(target=take_over, daemon=True)
        second.start()
        second.join(0.3)
        # It does not even send the greeting, because actions of the first one may still be running.
        self.assertEqual((taken_over, done), ([], [(0, False)]))
        first.world._ledger.release()
        second.join(30)
        reports, _ = taken_over[0].ask(type="look", facts=[], fluents=[], tickets=[0])
        self.assertEqual([it["type"] for it in reports], ["started"])

    def test_who_waits_for_a_ledger_ends_when_nobody_needs_it_any_more(self):
        Peer(self.world(True))
        world = self.world(True)
        there = os.pipe()
        source = os.fdopen(there[0])
        PIPES.append(source)
        with os.fdopen(there[1], "w") as mouth:
            mouth.write('{"type":"hello","protocol":"elbowroom-world","version":1,"versions":[1,2]}\n')
        with self.assertRaises(SystemExit):
            world.run(source, io.StringIO())

    def test_a_new_run_begins_with_an_empty_ledger(self):
        self.before()
        Peer(self.world(False))
        with open(self.ledger, encoding="utf-8") as file:
            self.assertEqual(file.read(), "")


if __name__ == "__main__":
    unittest.main()
