# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Requests of services that a thread answers one after the other."""

import threading

from ur_cartesian_driver.ros.services.deferred_service import (
    MAX_WAITING_REQUESTS,
    RequestQueue,
    SHUTDOWN_REFUSAL,
)


def test_requests_that_wait_are_bounded_and_refused_at_the_end():
    may_go_on = threading.Event()

    def answer(request):
        may_go_on.wait()
        return request

    queue = RequestQueue('measure the cell', answer, lambda text: text)
    closing = threading.Thread(target=queue.close)
    try:
        first, *others = [queue.submit(k) for k in range(MAX_WAITING_REQUESTS)]
        refused = queue.submit(-1).result(timeout=0.0)
        assert refused.startswith(f'{MAX_WAITING_REQUESTS} requests to measure the cell wait;')
        closing.start()
        assert {each.result(timeout=5.0) for each in others} == {SHUTDOWN_REFUSAL}
    finally:
        may_go_on.set()
    closing.join()
    assert first.result(timeout=5.0) == 0
    assert queue.submit(-1).result(timeout=0.0) == SHUTDOWN_REFUSAL
