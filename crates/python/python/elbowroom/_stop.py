"""Handle that ends runs from any thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Stop:
    """Handle that ends runs in order, from any thread or signal handler.

    The run cancels the running actions, calls :meth:`elbowroom.World.stop`, and returns with the verdict
    ``"interrupted"`` after at most 6 s.

    >>> handle = elbowroom.Stop()
    >>> handle.stop()
    >>> problem.run(PLAN, stop=handle).verdict
    'interrupted'
    >>> handle.run.verdict
    'interrupted'
    """

    run: Any
    """The last :class:`Run` that had this handle, once it has ended; ``None`` before."""

    def __init__(self) -> None:
        self.run = None
        self._is_requested = False
        self._listeners: list[Callable[[], None]] = []

    @property
    def is_requested(self) -> bool:
        """``True`` after :meth:`stop`."""
        return self._is_requested

    def stop(self) -> None:
        """Ends all runs that have this handle. Later runs end at once."""
        self._is_requested = True
        for listener in tuple(self._listeners):
            listener()

    def _connect(self, listener: Callable[[], None]) -> None:
        self._listeners.append(listener)
        if self._is_requested:
            listener()

    def _disconnect(self, listener: Callable[[], None]) -> None:
        self._listeners.remove(listener)
