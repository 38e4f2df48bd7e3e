# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Carry out the service calls of the owner, also during a motion."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
import logging

from ur_cartesian_driver.driver.ipc.channel import CallAnswered, CallRobot
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.robot.services.service_calls import EndContactWatchCall, failed
from ur_cartesian_driver.robot.services.service_dispatcher import ServiceDispatcher

#: Largest number of concurrent calls; only a call that ends a contact watch may exceed it.
MAX_CALLS = 32


class CallRunner:
    """Answers every call, even if carrying it out fails."""

    def __init__(
        self,
        dispatcher: ServiceDispatcher,
        pipe: OwnerPipe,
        spawn: Callable[[Coroutine[None, None, None]], None],
    ) -> None:
        """
        Begin with no calls.

        :param spawn: runs a coroutine concurrently.
        """
        self._dispatcher, self._pipe, self._spawn = dispatcher, pipe, spawn
        self._running = 0

    def start(self, request: CallRobot) -> None:
        """Carry out a call, or refuse it if too many are being carried out."""
        # Nothing but an EndContactWatchCall ends a watch for contact, so it is never refused.
        if self._running < MAX_CALLS or isinstance(request.call, EndContactWatchCall):
            self._running += 1
            self._spawn(self._answer(request))
        else:
            answer = failed(f'{MAX_CALLS} service calls are running; wait until one has ended.')
            self._pipe.send(CallAnswered(number=request.number, answer=answer))

    async def _answer(self, request: CallRobot) -> None:
        try:
            answer = await self._dispatcher.dispatch(request.call)
        except Exception as error:  # even then the caller must get an answer
            text = f'The driver has a defect, {type(error).__name__}: {error}.'
            self._pipe.log(logging.ERROR, f'{text} The call was {request.call}.')
            answer = failed(text)
        finally:
            self._running -= 1
        self._pipe.send(CallAnswered(number=request.number, answer=answer))
