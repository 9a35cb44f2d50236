"""Goals of ROS 2 action servers as the bodies of actions of a plan."""

import json
import sys
import threading
import time
import uuid

from action_msgs.msg import GoalStatus
from elbowroom_world import Failed
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from unique_identifier_msgs.msg import UUID

from .fields import FieldError
from .mapping import MappingError

PERIOD = 0.1
"""Interval of checks, in real seconds."""
CANCEL_EVERY = 2.0
"""Interval at which a cancellation is repeated until the goal ends, in real seconds."""
FEEDBACK_EVERY = 0.5
"""Least interval between two reports of the progress of a goal, in real seconds. Each is a line of the trace."""
LOST_AFTER = 1.0
"""Time without the server after which its goals have failed, in real seconds. ROS reports the end of a killed process only
after a while (Fast DDS: 20 s)."""


class Job:
    """An action of the plan, and its goal at a server."""

    def __init__(self, action, mapping, bindings, client, goal):
        self.action, self.mapping, self.bindings = action, mapping, bindings
        self.client, self.goal = client, goal
        self.since = time.monotonic()
        self.is_sent = False
        self.handle = None
        # Publishers of the server's status when the goal was sent: a restarted server has another one.
        self.servers = set()
        self.lost_since = None
        self.is_cancelled = False
        self.cancelled_at = None
        self.first_remaining = None
        self.progress, self.progress_at = None, float("-inf")


class ActionGoals:
    """Starts, monitors and cancels goals. All communication with ROS is in the thread of the node's executor."""

    def __init__(self, node, mapping, report_fact):
        self._node, self._mapping, self._report_fact = node, mapping, report_fact
        self.actions, self.server_wait = list(mapping.actions), mapping.seconds
        self._types = {name: it.action_type() for name, it in mapping.actions.items()}
        self._clients = {}
        self._jobs = {}
        self._lock = threading.RLock()
        self._wake = node.create_guard_condition(self._check)
        # The time of a simulation may stand still.
        node.create_timer(PERIOD, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def missing_servers(self):
        """Returns the required servers that are not there."""
        return [it for it in self._mapping.servers if not self._status_publishers(it)]

    def begin(self, action):
        """Begins an action, or continues one that was running before a restart."""
        mapping, kind = self._mapping.actions[action.name.lower()], self._types[action.name.lower()]
        try:
            bindings = mapping.bind(action)
            server = mapping.resolve(mapping.server, bindings)
            goal = mapping.fill_goal(kind.Goal(), bindings, self._node.get_clock().now().to_msg())
            if action.is_resumed:
                if action.memory is None:
                    raise Failed("the world was restarted before the goal was sent")
                server = json.loads(action.memory)["server"]
            client = self._client(server, kind)
        except (FieldError, MappingError, InvalidTopicNameException) as error:
            raise Failed(str(error)) from None
        if not action.is_resumed:
            action.remember(json.dumps({"server": server, "goal": uuid.uuid4().hex}))
        with self._lock:
            self._jobs[action.ticket] = Job(action, mapping, bindings, client, goal)
        self._wake.trigger()

    def cancel(self, action):
        """Requests that the goal of an action is cancelled."""
        with self._lock:
            job = self._jobs.get(action.ticket)
            if job is not None:
                job.is_cancelled = True
        self._wake.trigger()

    def cancel_all(self):
        """Requests that all goals are cancelled."""
        with self._lock:
            for job in self._jobs.values():
                job.is_cancelled = True
        self._wake.trigger()

    def wait_for_cancelled(self, within):
        """Waits for the ends of cancelled goals, for at most `within` seconds."""
        until = time.monotonic() + within
        while time.monotonic() < until and any(it.is_cancelled for it in list(self._jobs.values())):
            time.sleep(0.02)

    def _client(self, server, kind):
        with self._lock:
            if (server, kind) not in self._clients:
                self._clients[server, kind] = ActionClient(self._node, kind, server)
            return self._clients[server, kind]

    def _check(self):
        with self._lock:
            for job in list(self._jobs.values()):
                if not job.is_sent:
                    self._try_to_send(job)
                elif self._is_lost(job):
                    self._end(job, job.action.failed, f"the action server {name_of(job)} has disappeared")
                elif job.is_cancelled:
                    self._send_cancel(job)

    def _try_to_send(self, job):
        if job.is_cancelled and not job.action.is_resumed:
            self._end(job, job.action.was_cancelled)
        elif job.client.server_is_ready() and self._status_publishers(name_of(job)):
            job.servers = self._status_publishers(name_of(job))
            job.is_sent = True
            identifier = UUID(uuid=list(bytes.fromhex(json.loads(job.action.memory)["goal"])))
            if job.action.is_resumed:
                handle = ClientGoalHandle(job.client, identifier, job.client._action_type.Impl.SendGoalService.Response())
                self._follow(job, handle)
                return
            sent = job.client.send_goal_async(job.goal, lambda it: self._feedback(job, it.feedback), identifier)
            sent.add_done_callback(lambda it: self._accepted(job, it))
        elif time.monotonic() - job.since > self.server_wait:
            kind, within = job.mapping.type, self.server_wait
            self._end(job, job.action.failed, f"no action server {name_of(job)} of type {kind} within {within:g} s")

    def _status_publishers(self, server):
        # Only servers publish this topic, whereas clients count for the services.
        found = self._node.get_publishers_info_by_topic(f"{server}/_action/status")
        return {bytes(it.endpoint_gid) for it in found}

    def _is_lost(self, job):
        now = time.monotonic()
        if job.client.server_is_ready() and job.servers & self._status_publishers(name_of(job)):
            job.lost_since = None
        else:
            job.lost_since = job.lost_since or now
        return job.lost_since is not None and now - job.lost_since >= LOST_AFTER

    def _accepted(self, job, future):
        with self._lock:
            handle = future.result()
            if not handle.accepted:
                self._end(job, job.action.failed, f"the action server {name_of(job)} has rejected the goal")
                return
            if job.action.duration is not None:
                job.action.started()
            self._follow(job, handle)
            if job.is_cancelled:
                self._send_cancel(job)

    def _follow(self, job, handle):
        job.handle = handle
        handle.get_result_async().add_done_callback(lambda it: self._result(job, it.result()))

    def _send_cancel(self, job):
        now = time.monotonic()
        if job.handle is None or job.cancelled_at is not None and now - job.cancelled_at < CANCEL_EVERY:
            return
        is_first, job.cancelled_at = job.cancelled_at is None, now

        def answered(future):
            if is_first and not future.result().goals_canceling:
                text = f"{name_of(job)} does not accept the cancellation of {job.action.text}; it is repeated"
                print(text, file=sys.stderr, flush=True)

        job.handle.cancel_goal_async().add_done_callback(answered)

    def _feedback(self, job, feedback):
        with self._lock:
            if job.action.ticket in self._jobs:
                *progress, job.first_remaining = job.mapping.progress(feedback, job.first_remaining)
                now = time.monotonic()
                if progress != job.progress and now - job.progress_at >= FEEDBACK_EVERY:
                    job.progress, job.progress_at = progress, now
                    job.action.feedback(*progress)

    def _result(self, job, response):
        with self._lock:
            status, result = response.status, response.result
            if status == GoalStatus.STATUS_SUCCEEDED:
                why = job.mapping.failure_of(result)
                if why is not None:
                    self._end(job, job.action.failed, why)
                else:
                    succeeded = job.action.succeeded if job.action.duration is not None else job.action.started
                    self._end(job, succeeded, job.mapping.measured_changes(result, job.bindings))
            elif status in (GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED) and job.is_cancelled:
                self._end(job, job.action.was_cancelled)
            elif status == GoalStatus.STATUS_CANCELED:
                self._end(job, job.action.failed, f"another client has cancelled the goal at {name_of(job)}")
            elif status == GoalStatus.STATUS_ABORTED:
                self._end(job, job.action.failed, job.mapping.reason(result))
            else:
                self._end(job, job.action.failed, f"{name_of(job)} does not know the goal: it was restarted")

    def _end(self, job, report, *arguments):
        if self._jobs.pop(job.action.ticket, None) is None:
            return
        if report in (job.action.failed, job.action.was_cancelled):
            # Before the end, so that no plan is made without these facts.
            for fact, value in job.mapping.facts_after_failure(job.bindings).items():
                self._report_fact(fact, value)
        report(*arguments)


def name_of(job):
    """Returns the full name of the server."""
    return job.client._action_name
