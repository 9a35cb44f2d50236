"""Threads that read the streams of an executive."""

import json
import threading
import time

from .client import Unreachable, merge

RETRY = 0.3
"""Pause before a lost connection is established again, in seconds."""


class Subscription:
    """Reads the state and the trace of an executive, and passes them to functions, in threads of their own.

    `on_state(document)` receives each state, and `None` when the connection is lost; `on_line(number, line)` each line of
    the trace."""

    def __init__(self, client, on_state, on_line):
        self._client, self._on_state, self._on_line = client, on_state, on_line
        self._is_closed = threading.Event()
        self._last_line = 0
        for follow in (self._follow_state, self._follow_trace):
            threading.Thread(target=self._repeat, args=(follow,), daemon=True).start()

    def close(self):
        """Ends the threads. They may still pass what they have received."""
        self._is_closed.set()

    def restart(self):
        """Reads the trace from its beginning again: that of another process."""
        self._last_line = 0

    def _repeat(self, follow):
        while not self._is_closed.is_set():
            try:
                follow()
            except Unreachable:
                pass
            time.sleep(RETRY)

    def _follow_state(self):
        document = {}
        try:
            for event, _, data in self._client.stream("/v1/state/events"):
                if self._is_closed.is_set():
                    return
                if event == "over":
                    return
                document = json.loads(data) if event == "document" else merge(document, json.loads(data))
                self._on_state(document)
        finally:
            self._on_state(None)

    def _follow_trace(self):
        after = "" if self._last_line is None else f"?after={self._last_line}"
        try:
            # Without an action, there is no line for a long time.
            for event, number, data in self._client.stream(f"/v1/events{after}", timeout=None):
                if self._is_closed.is_set():
                    return
                if event == "entry":
                    self._last_line = int(number)
                    self._on_line(int(number), data)
        except Unreachable as error:
            if error.status == 410:
                # These lines are not kept any more.
                self._last_line = None
            raise
