# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The kinds of rows in the table of names, and the way in which each kind serves its names.

Types are texts, such as ``ur_msgs/srv/SetIO``, because most of their packages are not on PyPI.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeAlias

from rclpy.qos import QoSProfile

from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS, STATE_QOS, steady_timer
from ur_cartesian_driver.ros.services.deferred_service import DeferredService
from ur_cartesian_driver.ros.ur_driver_names.driver_node import ANSWER_TIMEOUT, DriverNode
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings

#: Starts the driver's call for a request, and returns the future of its answer.
Call: TypeAlias = Callable[['Service', DriverNode, Message], Future[ServiceAnswer]]


@dataclass(frozen=True, slots=True, kw_only=True)
class UrName:
    """One name of the UR ROS 2 driver."""

    #: topic, service or action.
    kind: str
    #: Relative to the namespace of the node.
    name: str
    #: Package, kind and name of the type.
    type: str
    #: The driver's topics, services or actions that serve it, separated by commas; empty = none.
    source: str = ''
    #: The only release that has the name; empty = all releases have it.
    release: str = ''

    def is_in(self, release: str) -> bool:
        """Return whether a release of the UR driver has the name."""
        return self.release in ('', release)

    @property
    def served_by(self) -> str:
        """The driver's topics, services or actions that serve the name, as text; '' = none."""
        return ', '.join(f'`~/{name}`' for name in self.source.split(', ') if name)

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """
        Start to serve; by default there is nothing to do.

        :param kind: the class of the type.
        :returns: an object that the node keeps, and closes if it has a method ``close()``.
        """
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Absent(UrName):
    """A name that is not served."""

    #: Why not, in a sentence.
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ByDriver(UrName):
    """A topic that the driver itself publishes under this name."""

    kind: str = 'topic'

    @property
    def served_by(self) -> str:
        """The name itself, because the driver publishes it."""
        return f'`{self.name}`'


@dataclass(frozen=True, slots=True, kw_only=True)
class Served(UrName):
    """A name with a server of its own."""

    #: Starts to serve; takes the row, and then the arguments of :meth:`UrName.offer`.
    server: Callable[[UrName, DriverNode, NamesSettings, Any], object]

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Start the server."""
        return self.server(self, driver, settings, kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic(UrName):
    """A topic that relays the messages of one of the driver's topics."""

    kind: str = 'topic'

    #: The class of the messages of the driver's topic.
    source_type: Any
    #: Converts a message of the driver's topic; None = nothing is published.
    convert: Callable[[Any, Message, NamesSettings], Message | None]
    #: Late subscribers get the last message.
    latched: bool = False
    #: The driver publishes on change, but subscribers of this name expect a stream.
    repeated: bool = False

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Publish the converted messages of the driver."""
        return _Relay(self, driver, settings, kind)


class _Relay:
    """Publishes the messages of one of the driver's topics under another name."""

    def __init__(self, row: Topic, driver: DriverNode, settings: NamesSettings, kind: Any) -> None:
        self._row, self._driver, self._settings, self._kind = row, driver, settings, kind
        self._publisher = driver.node.create_publisher(
            kind, row.name, LATCHED_QOS if row.latched else STATE_QOS
        )
        self._subscription: Any = None
        self._last: Message | None = None
        if row.latched or row.repeated:
            self._listen(LATCHED_QOS)
        else:
            driver.on_status(lambda _: self._listen_if_heard())
        if row.repeated:
            steady_timer(driver.node, 1.0 / settings.io_states_rate, self._repeat)

    def _listen(self, qos: QoSProfile) -> None:
        self._subscription = self._driver.subscribe(
            self._row.source_type, self._row.source, self._receive, qos
        )

    def _listen_if_heard(self) -> None:
        """Take messages only while there are subscribers: each message costs a millisecond."""
        is_heard = self._publisher.get_subscription_count() > 0
        if is_heard and self._subscription is None:
            self._listen(STATE_QOS)
        elif not is_heard and self._subscription is not None:
            self._driver.node.destroy_subscription(self._subscription)
            self._subscription = None

    def _receive(self, message: Message) -> None:
        converted = self._row.convert(self._kind, message, self._settings)
        if converted is not None:
            self._last = converted
            self._publisher.publish(converted)

    def _repeat(self) -> None:
        is_heard = self._publisher.get_subscription_count() > 0
        if is_heard and self._last is not None and self._driver.is_reporting:
            self._publisher.publish(self._last)


def same_request(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    """Call the driver's service with the values of the fields that both requests have."""
    ours = row.source_type.Request()
    for field in ours.get_fields_and_field_types().keys() & request.get_fields_and_field_types():
        setattr(ours, field, getattr(request, field))
    return driver.call(row.source_type, row.source, ours, row.timeout)


@dataclass(frozen=True, slots=True, kw_only=True)
class Service(UrName):
    """A service that calls one of the driver's services, and responds with its answer."""

    kind: str = 'service'

    #: The class of the driver's service; None = the source is a topic whose last message the node
    #: keeps.
    source_type: Any
    #: Starts the driver's call for a request; gets the row, too.
    call: Call = same_request
    #: How long the driver may take to answer [s].
    timeout: float = ANSWER_TIMEOUT
    #: Writes the text of an answer into the fields of the response.
    #:
    #: :raises ValueError: the text does not fit the fields.
    fill: Callable[[Message, str], None] = lambda response, text: None
    #: Returns the text of the response for the text of a successful answer.
    words: Callable[[str], str] = str

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Respond with the driver's answers."""
        if self.source_type is not None:
            driver.client(self.source_type, self.source)  # its discovery takes time

        def handle(request: Message) -> Future[Message]:
            response: Future[Message] = Future()
            self.call(self, driver, request).add_done_callback(
                lambda done: response.set_result(self._response(driver, kind, done.result()))
            )
            return response

        return DeferredService(driver.node, kind, self.name, handle)

    def _response(self, driver: DriverNode, kind: Any, answer: ServiceAnswer) -> Message:
        response, ok, text = kind.Response(), answer.ok, answer.text
        if ok:
            try:
                self.fill(response, text)
            except (ValueError, AssertionError):  # the latter: a number that a field cannot hold
                ok = False
            text = self.words(text)
        if hasattr(response, 'success'):
            response.success = ok
        for field in ('message', 'answer', 'status'):
            if hasattr(response, field):
                setattr(response, field, text)
                break
        else:
            if not ok:
                driver.warn(f'{self.name}: {text}')
        return response
