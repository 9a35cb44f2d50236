"""Worlds for `elbowroom run --world-process`, in Python, with nothing but the standard library.

A whole world:

    from elbowroom_world import Failed, World

    world = World("rover")

    @world.action("drive")
    def drive(action):
        rover, start, goal = action.arguments
        for done in robot.drive(goal):      # the robot's own way to do it
            action.feedback(done)           # 0 to 1
            if action.is_cancelled:
                return robot.stop()
        if not robot.is_at(goal):
            raise Failed("the wheels slip")

    @world.look
    def look(what):                         # ["at", "rover", "shelf"]
        return robot.believes(what)         # True, False, a number, or None: cannot tell

    world.run()

Three kinds of actions, told apart by how they are registered:

- ``@world.action(NAME)``: the function does the action and returns when it is done. Each call has a
  thread of its own. Returning is success, ``raise Failed(why)`` failure; an action that returns
  after it was cancelled is cancelled.
- ``@world.starter(NAME)``: the function only begins the action, and must not block. What comes of
  it is told later, from any thread: ``action.started()``, ``action.succeeded()``,
  ``action.failed(why)``, ``action.was_cancelled()``. For robots that call back. ``@world.canceller``
  names the function that asks such an action to stop.
- ``@world.lasts(NAME)``, of a :class:`Simulation`: the function returns how many seconds the action
  takes, and time jumps.

NAME ``"*"`` stands for every action that has no function of its own.

Whatever a program prints goes to standard error, so that ``print`` does not disturb the
conversation. `docs/reference/formats/world-protocol.md` describes the messages.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import time as _time
import traceback
from typing import Any, Callable, Iterable, TextIO

__all__ = ["Action", "Failed", "Simulation", "Stepped", "World"]

VERSION = 2

# Maximum number of reports in one answer. The others follow in the next answers.
MOST_NEWS = 1000


class Failed(Exception):
    """An action has failed; the text says why."""


class Action:
    """An action to execute."""

    def __init__(self, world: World, ticket: int, name: str, duration: float | None) -> None:
        self.ticket = ticket
        """The number of the start, unique within a run."""
        self.text = name
        """The ground action: ``(drive rover depot shelf)``."""
        words = name.strip("() ").split()
        self.name = words[0] if words else ""
        """The name: ``drive``."""
        self.arguments = words[1:]
        """The arguments: ``["rover", "depot", "shelf"]``."""
        self.duration = duration
        """The planned duration in seconds; ``None`` for an instantaneous action."""
        self.start: float | None = None
        """The start time on the world's clock."""
        self.is_resumed = False
        """``True`` if the action was running before this program was restarted."""
        self.memory: str | None = None
        """The text of :meth:`remember`, also after a restart."""
        self._world = world
        self._cancelled = threading.Event()

    @property
    def is_cancelled(self) -> bool:
        """``True`` if the action must stop."""
        return self._cancelled.is_set()

    def sleep(self, seconds: float) -> bool:
        """Waits for ``seconds`` of the world's time; returns ``False`` early when cancelled."""
        if self._world._interval is None:
            return not self._cancelled.wait(max(0.0, seconds) / self._world.speed)
        until = self._world.now() + seconds
        while self._world.now() < until:
            if self._cancelled.wait(self._world._interval):
                return False
        return not self.is_cancelled

    def remember(self, text: str) -> None:
        """Stores a text, such as the number of a robot's job, in :attr:`memory` and in the ledger, if there is one."""
        self.memory = text
        if self._world._ledger is not None:
            self._world._ledger.write(ticket=self.ticket, memory=text)

    def feedback(self, completion: float | None = None, note: str = "") -> None:
        """Reports progress: the completion from 0 to 1, and a note for the trace."""
        part = None if completion is None else min(1.0, max(0.0, float(completion)))
        self._tell(type="feedback", completion=part, note=note)

    def started(self, measured: dict[str, float] | None = None, *, stamp: Stamp | None = None) -> None:
        """Reports that the action has started: now, or at the time of the ``stamp`` (:meth:`World.clock`)."""
        self._tell(type="started", stamp=stamp, **({"measured": measured} if measured else {}))

    def succeeded(self, measured: dict[str, float] | None = None, *, stamp: Stamp | None = None) -> None:
        """Reports that the action has ended with the effects of the domain: now, or at the time of the ``stamp``.
        ``measured``: the measured changes of fluents, in place of those of the domain."""
        self._end("succeeded", stamp=stamp, **({"measured": measured} if measured else {}))

    def failed(self, why: str, *, stamp: Stamp | None = None) -> None:
        """Reports that the action has failed, without its end effects: now, or at the time of the ``stamp``."""
        self._end("failed", why=why, stamp=stamp)

    def was_cancelled(self) -> None:
        """Reports that the action has stopped after a cancellation."""
        self._end("cancelled")

    def _end(self, outcome: str, **more: Any) -> None:
        self._tell(type="ended", outcome=outcome, **more)

    def _tell(self, **message: Any) -> None:
        # The thread that writes decides which reports to send, because it knows the earlier ones.
        self._world._inbox.put(("report", dict(message, ticket=self.ticket), self._world.now()))

    def __repr__(self) -> str:
        return f"Action(#{self.ticket} {self.text})"


Does = Callable[[Action], Any]
Stamp = tuple[str, float]
"""A time of another clock, such as that of a robot's arm: the clock's name and its reading."""


class World:
    """A world on the wall clock. ``speed`` is the number of the world's seconds in one real second.

    With a ``ledger``, a file, the world can be restarted after a crash of its program or of
    Elbowroom: it records each start before the action begins, and each end, and reports these
    outcomes after ``elbowroom run --resume``. Only one program at a time uses a ledger: a second
    one waits until the first one has ended.

    ``clock``: a function that returns the present time in seconds, in place of the monotonic clock of the system, for
    example that of a simulator. It must not decrease.
    """

    capabilities: Iterable[str] = ("cancel", "feedback", "facts")

    def __init__(
        self,
        name: str = "world",
        *,
        speed: float = 1.0,
        ledger: str | os.PathLike[str] | None = None,
        clock: Callable[[], float] | None = None,
    ) -> None:
        if not speed > 0:
            raise ValueError(f"speed must be above 0, not {speed!r}")
        self._read = clock or _time.monotonic
        # Interval at which another clock is read during a wait, in real seconds.
        self._interval = None if clock is None else 0.02
        self.name, self.speed = name, speed
        self._ledger = _Ledger(ledger) if ledger is not None else None
        self._does: dict[str, tuple[str, Does]] = {}
        self._resumes: dict[str, Does] = {}
        self._canceller: Does | None = None
        self._look: Callable[[list[str]], Any] | None = None
        self._resumed: Callable[[list[Action]], Any] | None = None
        self._believed: Callable[[dict[str, bool], dict[str, float | None]], Any] | None = None
        self._inbox: queue.Queue[tuple[Any, ...]] = queue.Queue()
        self._actions: dict[int, Action] = {}
        self._begun: set[int] = set()
        self._ended: dict[int, dict[str, Any]] = {}
        self._news: list[dict[str, Any]] = []
        self._out: TextIO | None = None
        self._version = 1
        # Set when Elbowroom has ended.
        self._is_alone = threading.Event()
        # Reading of the clock at the world's time 0. That is the first message after the
        # greeting, so that preparations take no time.
        self._zero: float | None = None

    # Registration of functions.

    def action(self, *names: str, resumes: bool = False) -> Callable[[Does], Does]:
        """Registers a function that executes these actions, each call in a separate thread. ``resumes``: the function
        can also continue an action that was running before a restart (``action.is_resumed``)."""
        return self._register(names, "blocking", resumes)

    def starter(self, *names: str, resumes: bool = False) -> Callable[[Does], Does]:
        """Registers a function that starts these actions and returns at once; their ends are reported later."""
        return self._register(names, "starter", resumes)

    def canceller(self, function: Does) -> Does:
        """Registers a function that requests an action of :meth:`starter` to stop, and returns at once."""
        self._canceller = function
        return function

    def look(self, function: Callable[[list[str]], Any]) -> Callable[[list[str]], Any]:
        """Registers a function that observes the world: it receives the words of a fact or fluent, and returns the
        fact's truth value, the fluent's value, or ``None`` if it cannot observe it."""
        self._look = function
        return function

    def believed(
        self, function: Callable[[dict[str, bool], dict[str, float | None]], Any]
    ) -> Callable[[dict[str, bool], dict[str, float | None]], Any]:
        """Registers a function that receives the state that Elbowroom believes: first all true facts and all values,
        later only the changes: ``{"(at rover shelf)": True}``, ``{"(charge rover)": 17.5}``. It must not
        block."""
        self._believed = function
        return function

    def resumed(self, function: Callable[[list[Action]], Any]) -> Callable[[list[Action]], Any]:
        """Registers a function that is called once when a run resumes after a crash, with the actions that continue.
        It reports facts and values that differ from the effects of actions, such as those after a cancelled action."""
        self._resumed = function
        return function

    def _register(self, names: tuple[str, ...], kind: str, resumes: bool) -> Callable[[Does], Does]:
        if not names or not all(isinstance(name, str) for name in names):
            raise TypeError('expected names of actions: @world.action("drive")')

        def register(function: Does) -> Does:
            for name in names:
                self._does[name.lower()] = (kind, function)
                if resumes:
                    self._resumes[name.lower()] = function
            return function

        return register

    # Reports without a request, from any thread.

    def fact(self, name: str, becomes: bool, *, stamp: Stamp | None = None) -> None:
        """Reports an observed fact: ``world.fact("(open door)", False)``; now, or at the time of the ``stamp``."""
        report = {"type": "fact", "fact": name, "becomes": bool(becomes), "stamp": stamp}
        self._inbox.put(("report", report, self.now()))

    def value(self, fluent: str, value: float, *, stamp: Stamp | None = None) -> None:
        """Reports an observed value: ``world.value("(charge rover)", 17.5)``; now, or at the time of the ``stamp``."""
        report = {"type": "value", "fluent": fluent, "value": value, "stamp": stamp}
        self._inbox.put(("report", report, self.now()))

    def clock(self, name: str, reads: float, rate: float | None = None) -> None:
        """Reports the present reading of another clock: ``world.clock("arm", 1700000012.4)``. Call it regularly. After
        that, reports can give times on that clock: ``world.fact("(open door)", True, stamp=("arm", 1700000012.9))``.
        ``rate`` is the number of that clock's seconds in one of the world's; without it, the rate is measured between
        readings. Version 1 of the protocol has one clock only, and reports have the present time."""
        report = {"type": "clock", "clock": name, "reads": float(reads)}
        report.update({} if rate is None else {"rate": float(rate)})
        self._inbox.put(("report", report, self.now()))

    def now(self) -> float:
        """Returns the present time: seconds since the run began."""
        return 0.0 if self._zero is None else (self._read() - self._zero) * self.speed

    # Communication.

    def run(self, input: TextIO | None = None, output: TextIO | None = None) -> None:
        """Communicates with Elbowroom until it sends ``stop`` or ends. Only the calling thread writes messages."""
        source, self._out = input or sys.stdin, output or sys.stdout
        if output is None:
            # Standard output carries the protocol, so the program's own output goes to standard
            # error.
            sys.stdout = sys.stderr
        threading.Thread(target=self._listen, args=(source,), daemon=True).start()
        question: dict[str, Any] | None = None
        while True:
            kind, *rest = self._next(question)
            if kind == "report":
                self._take(*rest)
            elif kind == "message":
                (message,) = rest
                what = message.get("type")
                if what in ("wait", "look"):
                    self._begin_time()
                    question = message
                    if what == "look":
                        self._see(message)
                elif what == "stop":
                    break
                else:
                    self._obey(what, message)
            elif kind == "end":
                break
            is_all = self._inbox.empty() or len(self._news) >= MOST_NEWS
            if question is not None and is_all and self._is_due(question):
                self._answer(question)
                question = None
        self._leave()

    def _listen(self, source: TextIO) -> None:
        for line in source:
            try:
                message = json.loads(line)
            except ValueError:
                print(f"{self.name}: cannot parse: {line.rstrip()}", file=sys.stderr)
                continue
            if isinstance(message, dict):
                self._inbox.put(("message", message))
        self._is_alone.set()
        self._inbox.put(("end",))

    def _next(self, question: dict[str, Any] | None) -> tuple[Any, ...]:
        """Returns the next event: a message, a report, or the end of the wait."""
        if question is None:
            return self._inbox.get()
        left = max(0.0, (_number(question.get("until")) or 0.0) - self.now()) / self.speed
        try:
            most = threading.TIMEOUT_MAX if self._interval is None else self._interval
            return self._inbox.get(timeout=min(left, most))
        except queue.Empty:
            return ("time",)

    def _is_due(self, question: dict[str, Any]) -> bool:
        until = _number(question.get("until"))
        return bool(self._news) or until is None or self.now() >= until

    def _answer(self, question: dict[str, Any]) -> None:
        for report in self._news:
            self._say(report)
        self._news.clear()
        time = {"type": "time", "now": self._time(question)}
        if "question" in question and self._version >= 2:
            time["question"] = question["question"]
        self._say(time)

    def _time(self, question: dict[str, Any]) -> float:
        return self.now()

    def _say(self, message: dict[str, Any]) -> None:
        assert self._out is not None
        try:
            self._out.write(json.dumps(message) + "\n")
            self._out.flush()
        except (BrokenPipeError, ValueError):
            # Elbowroom has ended. The reading thread detects that at the end of the input.
            pass

    def _obey(self, what: Any, message: dict[str, Any]) -> None:
        if what == "hello":
            self._greet(message)
            return
        if what == "believed":
            self._hear_believed(message)
            return
        self._begin_time()
        if what == "start":
            self._start(message)
        elif what == "cancel":
            action = self._actions.get(message.get("ticket", -1))
            if action is not None and action.ticket not in self._ended:
                action._cancelled.set()
                self._cancel(action)

    def _hear_believed(self, message: dict[str, Any]) -> None:
        if self._believed is None:
            return
        values = {name: _number(value) for name, value in message.get("values", {}).items()}
        try:
            self._believed(dict(message.get("facts", {})), values)
        except Exception:  # what is made of it is no part of the conversation
            traceback.print_exc()

    def _begin_time(self) -> None:
        if self._zero is None:
            self._zero = self._read()
            if self._ledger is not None:
                # The monotonic clock does not continue over a restart, but the wall clock does.
                self._ledger.write(zero=_time.time() if self._interval is None else self._zero)

    def _greet(self, message: dict[str, Any]) -> None:
        resumed = message.get("resumed")
        if self._ledger is not None:
            self._ledger.claim(self._is_alone.is_set)
            if resumed is None:
                self._ledger.begin()
            else:
                self._remember(self._ledger.read())
        missing = [name for name in message.get("actions", []) if name.lower() not in self._does]
        if missing and "*" not in self._does:
            print(f"{self.name}: these actions will fail, as they have no function: {', '.join(missing)}",
                  file=sys.stderr)  # fmt: skip
        if VERSION not in message.get("versions", [message.get("version")]):
            return
        self._version = VERSION
        can = list(self.capabilities)
        can += ["look"] if self._look is not None else []
        can += ["resume"] if self._ledger is not None else []
        can += ["beliefs"] if self._believed is not None else []
        self._say({"type": "hello", "version": VERSION, "name": self.name, "can": can})

    def _start(self, message: dict[str, Any]) -> None:
        ticket = message["ticket"]
        if ticket in self._actions:
            return  # said twice, done once
        action = Action(self, ticket, message["action"], _number(message.get("duration")))
        self._actions[ticket] = action
        found = self._does.get(action.name.lower()) or self._does.get("*")
        if found is None:
            self._take({"type": "ended", "ticket": ticket, "outcome": "failed",
                        "why": f"this world has no action {action.name}"}, self.now())  # fmt: skip
            return
        if self._ledger is not None:
            # Written before the action begins: an action that is not in the ledger was never
            # started.
            self._ledger.write(ticket=ticket, action=action.text, duration=action.duration,
                               start=self.now())  # fmt: skip
        self._launch(found, action)

    def _launch(self, found: tuple[str, Does], action: Action) -> None:
        kind, function = found
        if kind == "starter":
            self._call(function, action)
        else:
            # The start of an instantaneous action is reported when it is done.
            if not action.is_resumed and action.duration is not None:
                self._take({"type": "started", "ticket": action.ticket}, self.now())
            threading.Thread(target=self._do, args=(function, action), daemon=True).start()

    def _do(self, function: Does, action: Action) -> None:
        """Does an action, in its own thread."""
        if self._call(function, action):
            if action.is_cancelled:
                action.was_cancelled()
            elif action.duration is None:
                action.started()
            else:
                action.succeeded()

    def _call(self, function: Does, action: Action) -> bool:
        try:
            function(action)
            return True
        except Failed as failure:
            action.failed(str(failure))
        except Exception as error:  # a robot's slip is that action's, not the world's
            traceback.print_exc()
            action.failed(f"{type(error).__name__}: {error}")
        return False

    def _cancel(self, action: Action) -> None:
        kind, _ = self._does.get(action.name.lower()) or self._does.get("*") or ("", None)
        if kind == "starter" and self._canceller is not None:
            self._call(self._canceller, action)

    def _take(self, report: dict[str, Any], at: float) -> None:
        """Queues a report; each start and each end is reported once, in this order."""
        report = dict(report, time=max(0.0, at))
        ticket, what, stamp = report.get("ticket"), report["type"], report.pop("stamp", None)
        if what == "clock" and self._version < 2:
            return
        if ticket is not None:
            if ticket in self._ended or (what == "started" and ticket in self._begun):
                return
            if what == "feedback" and self._version < 2:
                return
            action = self._actions[ticket]
            if what == "started":
                self._begun.add(ticket)
                action.start = at
            elif what == "ended":
                if ticket not in self._begun and report["outcome"] == "succeeded":
                    self._take({"type": "started", "ticket": ticket}, at)
                self._ended[ticket] = report
                if self._ledger is not None:
                    self._ledger.write(report=report)
            if what == "started" and action.duration is None:
                # An instantaneous action is over when it has started.
                self._ended[ticket] = report
                if self._ledger is not None:
                    self._ledger.write(report=dict(report, type="ended", outcome="succeeded"))
        if stamp is not None and self._version >= 2:
            # Only this report has the time of the other clock. Answers after a crash use the
            # world's time, because other clocks are not known then.
            report = dict(report, clock=stamp[0], time=float(stamp[1]))
        self._news.append(report)

    def _see(self, question: dict[str, Any]) -> None:
        """Answers a request for facts and numbers."""
        now = self.now()
        for ticket in question.get("tickets", []):
            if ticket in self._ended:
                self._again(self._ended[ticket])
            elif ticket in self._actions:
                start = self._actions[ticket].start
                if start is not None:
                    self._again({"type": "started", "ticket": ticket, "time": start})
            else:
                self._again({"type": "unknown", "ticket": ticket, "time": now})
        if self._look is None:
            return
        for kind, key, name in (
            *(("fact", "becomes", name) for name in question.get("facts", [])),
            *(("value", "value", name) for name in question.get("fluents", [])),
        ):
            try:
                seen = self._look(name.strip("() ").split())
            except Exception:
                traceback.print_exc()
                continue
            if seen is not None:
                what = "fact" if kind == "fact" else "fluent"
                self._news.append({"type": kind, what: name, key: seen, "time": now})

    def _again(self, report: dict[str, Any]) -> None:
        if report not in self._news:
            self._news.append(report)

    def _remember(self, lines: list[dict[str, Any]]) -> None:
        """Restores the actions and reports from before the restart."""
        self._continue_time(lines)
        for line in lines:
            if "zero" in line:
                continue
            if "report" in line:
                self._ended[line["report"]["ticket"]] = line["report"]
            elif "memory" in line:
                self._actions[line["ticket"]].memory = line["memory"]
            elif "ticket" in line:
                action = Action(self, line["ticket"], line["action"], line.get("duration"))
                action.start, action.is_resumed = line["start"], True
                self._actions[action.ticket] = action
                self._begun.add(action.ticket)
        under_way = []
        for ticket, action in list(self._actions.items()):
            if ticket in self._ended:
                continue
            found = self._does.get(action.name.lower()) or self._does.get("*")
            if found is not None and (action.name.lower() in self._resumes or "*" in self._resumes):
                under_way.append(action)
                self._launch(found, action)
            else:
                action.failed("it was running when the world was restarted")

        if self._resumed is not None:
            self._resumed(under_way)

    def _continue_time(self, lines: list[dict[str, Any]]) -> None:
        """Sets the world's time after a restart, by the wall clock or the world's own, but not before the last time in the
        ledger."""
        for line in lines:
            if "zero" in line:
                is_other = self._interval is not None
                self._zero = line["zero"] if is_other else self._read() - (_time.time() - line["zero"])
        if self._zero is None:
            return
        times = [line.get("report", {}).get("time", line.get("start", 0.0)) for line in lines]
        last = max(time for time in times if time is not None)
        if self.now() < last:
            print(f"{self.name}: the clock was set back; time continues at {last:.3f} s", file=sys.stderr)
            self._zero = self._read() - last / self.speed

    def _leave(self) -> None:
        """Stops the running actions when the run is over or Elbowroom has ended, unless they can be resumed."""
        if self._ledger is None:
            for action in self._actions.values():
                if action.ticket not in self._ended:
                    action._cancelled.set()
                    self._cancel(action)


class Simulation(World):
    """A simulated world whose time jumps from event to event.

        world = Simulation()

        @world.lasts("*")
        def lasts(action):
            return 1.1 * action.duration

        world.run()
    """

    def __init__(self, name: str = "simulation") -> None:
        super().__init__(name)
        self._clock = 0.0
        self._coming: list[tuple[float, int, dict[str, Any]]] = []

    def lasts(self, *names: str) -> Callable[[Callable[[Action], float]], Callable[[Action], float]]:
        """Registers a function that returns the duration of these actions in seconds. It may ``raise Failed(why)``:
        then the action does not start. Its result for an instantaneous action is ignored."""
        return self._register(names, "lasts", False)

    def now(self) -> float:
        return self._clock

    def fact_at(self, time: float, name: str, becomes: bool) -> None:
        """Schedules a spontaneous change of a fact at that time."""
        self._coming.append((time, -1, {"type": "fact", "fact": name, "becomes": becomes}))

    def _launch(self, found: tuple[str, Does], action: Action) -> None:
        kind, function = found
        if kind != "lasts":
            raise TypeError(f"a simulation runs no threads; use @world.lasts({action.name!r})")
        try:
            # Functions may multiply the planned duration even if there is none.
            is_instantaneous = action.duration is None
            action.duration = action.duration or 0.0
            seconds = function(action)
        except Failed as failure:
            self._take({"type": "ended", "ticket": action.ticket, "outcome": "failed",
                        "why": str(failure)}, self._clock)  # fmt: skip
            return
        finally:
            action.duration = None if is_instantaneous else action.duration
        self._take({"type": "started", "ticket": action.ticket}, self._clock)
        if not is_instantaneous:
            end = {"type": "ended", "ticket": action.ticket, "outcome": "succeeded"}
            self._coming.append((self._clock + max(0.0, float(seconds)), action.ticket, end))

    def _cancel(self, action: Action) -> None:
        self._coming = [it for it in self._coming if it[1] != action.ticket]
        self._take({"type": "ended", "ticket": action.ticket, "outcome": "cancelled"}, self._clock)

    def _next(self, question: dict[str, Any] | None) -> tuple[Any, ...]:
        if question is None or not self._inbox.empty():
            return self._inbox.get()
        return ("time",)

    def _is_due(self, question: dict[str, Any]) -> bool:
        until = _number(question.get("until"))
        if self._news or until is None:
            return True
        self._coming.sort(key=lambda it: it[:2])
        if self._coming and self._coming[0][0] <= until:
            self._clock = max(self._clock, self._coming[0][0])
            # Simultaneous reports belong to one answer.
            while self._coming and self._coming[0][0] <= self._clock:
                _, _, report = self._coming.pop(0)
                self._take(report, self._clock)
        else:
            self._clock = max(self._clock, until)
        return True

    def _time(self, question: dict[str, Any]) -> float:
        return self._clock


class Stepped(World):
    """Simulator that advances in steps; derive from it.

        class Depot(Stepped):
            def begin(self, action):
                robots[action.arguments[0]].command(action)

            def step(self, dt):
                physics.advance(dt)
                for action in physics.finished():
                    action.succeeded()

            def cancel(self, action):
                robots[action.arguments[0]].halt()

        Depot().run()

    ``pace`` is how many of its seconds pass in one real second; without it, it runs as fast as possible. All methods
    are called in the thread of :meth:`World.run`, one after the other. Reports may be made in any thread.
    """

    dt = 0.1
    """Longest step, in seconds of the simulation."""

    def __init__(self, name: str = "simulation", *, pace: float | None = None) -> None:
        super().__init__(name)
        self._clock, self._pace = 0.0, pace
        self._does["*"] = ("stepped", self.begin)

    def begin(self, action: Action) -> None:
        """Begins an action. It may ``raise Failed(why)``; then the action does not start. An instantaneous action
        (``duration`` is ``None``) happens here."""
        raise NotImplementedError("a stepped world needs a method begin(action)")

    def step(self, dt: float) -> float | None:
        """Advances the simulation by ``dt`` seconds, at most :attr:`dt`. A simulator with a fixed step returns how
        much time has passed."""
        raise NotImplementedError("a stepped world needs a method step(dt)")

    def cancel(self, action: Action) -> None:
        """Stops a running action at once."""
        raise NotImplementedError("a stepped world needs a method cancel(action)")

    def now(self) -> float:
        return self._clock

    def _launch(self, found: tuple[str, Does], action: Action) -> None:
        _, function = found
        if self._call(function, action):
            self._take({"type": "started", "ticket": action.ticket}, self._clock)

    def _cancel(self, action: Action) -> None:
        self.cancel(action)
        self._take({"type": "ended", "ticket": action.ticket, "outcome": "cancelled"}, self._clock)

    def _next(self, question: dict[str, Any] | None) -> tuple[Any, ...]:
        if question is None or not self._inbox.empty():
            return self._inbox.get()
        return ("time",)

    def _is_due(self, question: dict[str, Any]) -> bool:
        until = _number(question.get("until"))
        if self._news or until is None or self._clock >= until:
            return True
        before, dt = self._clock, min(self.dt, until - self._clock)
        # Reports during a step have the time of its end.
        self._clock = before + dt
        passed = self.step(dt)
        if passed is not None:
            self._clock = before + passed
        if self._pace is not None:
            due = (self._zero or 0.0) + self._clock / self._pace
            _time.sleep(max(0.0, due - _time.monotonic()))
        # Elbowroom notices a clock that does not advance.
        return self._inbox.empty() and not before < self._clock < until


class _Ledger:
    """Log of started and ended actions, one per line, on disk before each is reported."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = os.fspath(path)
        self._file: TextIO | None = None
        self._lock: TextIO | None = None
        self._writing = threading.Lock()

    def claim(self, is_over: Callable[[], bool]) -> None:
        """Waits until no other program uses this ledger, because actions of that program may continue until it ends. The
        operating system releases the lock when this program ends, even after a crash."""
        self._lock = open(self._path + ".lock", "w", encoding="utf-8")
        is_said = False
        while not _locked(self._lock.fileno()):
            if is_over():
                sys.exit(f"{self._path} is in use by another program")
            if not is_said:
                print(f"waiting for the end of the program that uses {self._path}", file=sys.stderr)
                is_said = True
            _time.sleep(0.02)

    def release(self) -> None:
        """Releases the ledger before this program has ended."""
        for file in (self._file, self._lock):
            if file is not None:
                file.close()

    def begin(self) -> None:
        """Begins a new run: discards the contents of the last one."""
        self._file = open(self._path, "w", encoding="utf-8")

    def read(self) -> list[dict[str, Any]]:
        lines = []
        try:
            with open(self._path, encoding="utf-8") as file:
                for line in file:
                    try:
                        lines.append(json.loads(line))
                    except ValueError:
                        break  # cut off in the middle
        except FileNotFoundError:
            pass
        # A truncated last line is removed from the file.
        self._file = open(self._path + ".new", "w", encoding="utf-8")
        for line in lines:
            self.write(**line)
        os.replace(self._path + ".new", self._path)
        return lines

    def write(self, **line: Any) -> None:
        assert self._file is not None, "a ledger must begin with the greeting"
        with self._writing:
            self._file.write(json.dumps(line) + "\n")
            self._file.flush()
            os.fsync(self._file.fileno())


if sys.platform == "win32":
    import msvcrt

    def _locked(file: int) -> bool:
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _locked(file: int) -> bool:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def _number(value: Any) -> float | None:
    """A number as Elbowroom writes it."""
    if isinstance(value, dict):
        value = value.get("decimal")
    return None if value is None else float(value)
