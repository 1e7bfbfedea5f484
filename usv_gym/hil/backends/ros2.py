"""ROS 2 by rclpy, of the user's ROS installation.  Messages are reliable, with a queue of 100."""

from __future__ import annotations

import contextlib
import importlib
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from ...config import ConfigError
from ..profile import Row
from . import Receive
from .ros import fill, read

_TIME = ("sec", "nanosec")
DEPTH = 100  #: messages of a queue; ten are too few when a machine stalls
DEPTH_IN = 1000  #: of those that come in
SENDERS = 256  #: whose numbers are remembered


class Ros2:
    """One node; callbacks run in a thread of their own and do nothing but hand over."""

    name = "ros2"
    max_rate = 500.0
    OPTIONS: ClassVar[dict[str, str]] = {"node": "name of the node", "namespace": "of the topics, as /wamv"}

    def __init__(self, node: str = "usv_gym", namespace: str = "") -> None:
        """Nothing is imported yet."""
        self._name, self._namespace = node, namespace
        self._counters: Counter[str] = Counter()
        self._numbers: dict[tuple[Row, bytes], int] = {}  # the last one of each sender
        self._node: Any = None

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Start a node, advertise and subscribe."""
        try:
            import rclpy
            from rclpy.executors import SingleThreadedExecutor
            from rclpy.qos import QoSProfile, ReliabilityPolicy
            from rclpy.signals import SignalHandlerOptions
        except ImportError as error:
            raise ConfigError(
                f"backend ros2: {error}; source a ROS 2 installation (. /opt/ros/DISTRO/setup.bash), or make an "
                "environment with ros/ros2_venv.sh"
            ) from None
        classes = {row: self._class(row) for row in (*out, *incoming)}
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(self._name, context=self._context, namespace=self._namespace or None)
        kept = QoSProfile(depth=DEPTH)
        self._publishers: dict[Row, tuple[Any, Any]] = {}
        for row in out:
            if (cls := classes[row]) is not None:
                self._publishers[row] = self._node.create_publisher(cls, row.topic, kept), cls
        for row in incoming:
            if (cls := classes[row]) is not None:
                # where the boat is may come from a driver of a sensor, which often offers best effort only
                best = ReliabilityPolicy.BEST_EFFORT if row.command == "own_pose" else ReliabilityPolicy.RELIABLE
                qos = QoSProfile(depth=DEPTH_IN, reliability=best)
                self._node.create_subscription(cls, row.topic, self._callback(row, receive), qos)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="usv_gym ros2", daemon=True)
        self._thread.start()

    def _class(self, row: Row) -> Any:
        package, _, kind = row.type.partition("/")
        try:
            return getattr(importlib.import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError):
            if not kind:
                raise ConfigError(
                    f"{row.topic}: {row.type!r} is no ROS message; is this a profile for another backend?"
                ) from None
            if package != "usv_gym_msgs":
                raise ConfigError(f"{row.topic}: ROS 2 has no message {row.type}; is its package installed?") from None
            import warnings

            warnings.warn(f"{row.topic}: left out: usv_gym_msgs is not built (docs/hil.md)", stacklevel=2)
            return None

    def _callback(self, row: Row, receive: Receive) -> Any:
        def heard(message: Any, info: Mapping[str, Any]) -> None:
            self._count_lost(row, info)
            try:
                values = read(message, message.get_fields_and_field_types(), _TIME)
            except Exception as error:  # nothing that comes in may stop the executor
                self._counters[f"broken: {type(error).__name__}"] += 1
                return
            receive(row, values)

        return heard

    def _count_lost(self, row: Row, info: Mapping[str, Any]) -> None:
        """What a sender's or our own queue has dropped leaves a gap in the sender's numbers."""
        number, sender = info.get("publication_sequence_number"), info.get("publisher_gid")
        if number is None or sender is None:
            return
        key = row, bytes(sender["data"])
        last = self._numbers.pop(key, None)
        if last is not None and number > last + 1:
            self._counters[f"lost on the way: {row.topic}"] += number - last - 1
        self._numbers[key] = number
        if len(self._numbers) > SENDERS:
            del self._numbers[next(iter(self._numbers))]  # that has been silent for longest

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()

    def publish(self, row: Row, message: Any) -> None:
        """Send one message."""
        if (pair := self._publishers.get(row)) is None:
            return
        publisher, cls = pair
        try:
            publisher.publish(fill(cls(), message, _TIME))
        except Exception as error:  # a value that does not fit its type: the profile is to blame
            self._counters[f"not sent: {row.topic}: {type(error).__name__}"] += 1

    def step(self) -> None:
        """Nothing to flush."""

    def peers(self) -> int:
        """Subscribers of the topic that has most."""
        return max((publisher.get_subscription_count() for publisher, _ in self._publishers.values()), default=0)

    def counters(self) -> Mapping[str, int]:
        """What could not be read or sent."""
        return dict(self._counters)

    def close(self) -> None:
        """Take the node away."""
        if self._node is None:
            return
        import rclpy

        self._executor.shutdown(timeout_sec=1.0)
        self._thread.join(timeout=2.0)
        self._node.destroy_node()
        self._node = None
        rclpy.shutdown(context=self._context)
