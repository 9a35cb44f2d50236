"""Execution of plans: the methods of a problem that run them."""

from __future__ import annotations

import asyncio
import json
import os
import warnings
from typing import Any

from . import _native
from ._answers import Run
from ._errors import InterruptedWarning
from ._execution import Stepped
from ._native import DEFAULT_EXECUTOR
from ._runs import RunRequest, run_options
from ._stepped import SteppedWorld
from ._stop import Stop
from ._tables import ProgressCallback, listener
from ._texts import AnyPlan, PlannerCallable, Text, native_planner
from ._world import AsyncWorld, World


class Executable:
    """Problem whose plans can be executed."""

    _native: _native.Task

    def _plan_text(self, plan: AnyPlan) -> tuple[str, str]:
        raise NotImplementedError

    def run(
        self,
        plan: AnyPlan | None = None,
        *,
        world: World | SteppedWorld | Text | None = None,
        executor: str = DEFAULT_EXECUTOR,
        planner: str | PlannerCallable = "embedded",
        seed: int = 0,
        trace: bool = True,
        wall_time_limit: float | None = None,
        progress: ProgressCallback | bool | None = None,
        stop: Stop | None = None,
        **options: Any,
    ) -> Run:
        """Executes a plan in a world: dispatches its actions, monitors them, and replans.

        Args:
            plan: the initial plan; by default, the planner makes one.
            world: a :class:`World` or a :class:`SteppedWorld` in Python, or a world file (``docs/reference/formats/world.md``); without
                one, all durations and outcomes are as planned.
            executor: the name of the executor; :func:`elbowroom.executors` lists them.
            planner: the planner for new plans: ``"embedded"``, ``"none"``, another planner's name or
                command line, or a function of the texts of domain and problem.
            seed: the random seed of a simulated world.
            trace: ``True`` to keep the record of the run.
            wall_time_limit: limit in seconds on the wall clock; then the run ends in order.
            progress: receives the events of the run; ``True`` shows a bar.
            stop: a handle that ends the run in order, from any thread.
            options: further members of a run's specification, as the header of a trace has them
                (``docs/reference/formats/trace.md``): ``time_limit`` and ``planning_time`` in the world's
                seconds, ``timeout`` (as in :meth:`envelope`), ``max_replans``, ``vary``,
                ``guarantee``, ``precision``, ``running``, ``likelihoods``, ``believed`` (the world file that the executor
                believes, for example of a world in Python), ``self_overlap``, …; and ``jobs``, the number of threads of the
                embedded planner: 1 unless it is given, 0 for one for each processor. It does not change plans, and is
                not part of the trace.

        Returns:
            The run, even if the goal was not reached. Ctrl-C ends the run in order: running actions are
            cancelled, their ends are awaited for at most 5 s, and the world's ``stop`` is called. A second Ctrl-C is
            ignored meanwhile. A third one ends the run at once.

        Raises:
            RequestError: if the options contradict each other.
            WorldError: if the world raises an exception, which is its ``__cause__``.

        >>> run = problem.run(PLAN)
        >>> run.verdict, run.time
        ('goal-reached', Fraction(30003, 1000))
        """
        request = RunRequest(
            self._native,
            None if plan is None else self._plan_text(plan),
            world=world,
            executor=executor,
            planner=planner,
            seed=seed,
            trace=trace,
            wall_time_limit=wall_time_limit,
            progress=listener(progress),
            stop=stop,
            **options,
        )
        run, warning = request.execute()
        if warning is not None:
            warnings.warn(warning, InterruptedWarning, 2)
        return run

    def execution(
        self,
        plan: AnyPlan | None = None,
        *,
        executor: str = DEFAULT_EXECUTOR,
        planner: str | PlannerCallable = "embedded",
        trace: bool = True,
        **options: Any,
    ) -> Stepped:
        """Returns an execution that the caller's event loop drives step by step.

        Arguments and errors are those of :meth:`run`.

        >>> execution = problem.execution(PLAN)
        >>> execution.next_command().action.name
        '(drive rover depot shelf)'
        """
        chosen = run_options(executor, planner, 0, options)
        chosen.setdefault("world_process", "python")
        native = _native.Stepper(
            self._native,
            None if plan is None else self._plan_text(plan),
            json.dumps(chosen),
            native_planner(planner),
            trace,
        )
        return Stepped(native)

    async def run_async(
        self,
        plan: AnyPlan | None = None,
        *,
        world: AsyncWorld | World | SteppedWorld,
        progress: ProgressCallback | bool | None = None,
        **options: Any,
    ) -> Run:
        """Executes a plan in a world whose methods are coroutines.

        Arguments and errors are those of :meth:`run`. Plans are made in a thread, so that the event loop continues.
        If the task is cancelled, the run ends in order. The :class:`asyncio.CancelledError` has it as ``run``.
        """
        if world is None or isinstance(world, (str, os.PathLike)):
            raise TypeError("run_async needs a world in Python; use `problem.run` for world files")
        request = RunRequest(
            self._native,
            None if plan is None else self._plan_text(plan),
            world=world,
            progress=listener(progress),
            loop=asyncio.get_running_loop(),
            **options,
        )
        return await request.execute_async()
