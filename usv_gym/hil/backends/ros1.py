"""ROS 1 by rospy.  Message types that are not built are generated at run time from the definitions in ``ros/``."""

from __future__ import annotations

import sys
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ...config import ConfigError
from ...resources import ros
from ..profile import Row
from . import Receive
from .ros import fill, read

_TIME = ("secs", "nsecs")
DEBIAN = "/usr/lib/python3/dist-packages"  #: where Debian's packages put rospy
DEPTH = 100  #: messages that wait for a slow subscriber
_DEFINITIONS = (Path("/usr/share"), Path("/opt/ros/noetic/share"))  #: PACKAGE/msg/TYPE.msg


class Ros1:
    """One node; rospy's threads hand over what they hear."""

    name = "ros1"
    max_rate = 1000.0
    OPTIONS: ClassVar[dict[str, str]] = {
        "node": "name of the node",
        "namespace": "of the topics, as /odin",
        "master": "URI",
    }

    def __init__(self, node: str = "usv_gym", namespace: str = "", master: str = "") -> None:
        """Nothing is imported yet."""
        self._name, self._namespace, self._master = node, namespace.rstrip("/"), master
        self._counters: Counter[str] = Counter()
        self._publishers: dict[Row, tuple[Any, Any]] = {}
        self._subscribers: list[Any] = []
        self._closed = threading.Event()

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Register with the master, advertise and subscribe."""
        import os

        if self._master:
            os.environ["ROS_MASTER_URI"] = self._master
        os.environ.setdefault("ROS_MASTER_URI", "http://127.0.0.1:11311")
        os.environ.setdefault("ROS_IP", "127.0.0.1")  # listen and announce on this machine only
        rospy = _rospy()
        try:
            import rosgraph

            rosgraph.Master("/usv_gym").getPid()
        except Exception as error:
            raise ConfigError(f"backend ros1: no master at {os.environ['ROS_MASTER_URI']}: start roscore, or "
                              f"`rosmaster --core -p 11311` ({error})") from None  # fmt: skip
        rospy.init_node(self._name, disable_signals=True, disable_rostime=True, anonymous=False)
        classes = {row: message_class(row.type, row.topic) for row in (*out, *incoming)}
        for row in out:
            publisher = rospy.Publisher(self._topic(row), classes[row], queue_size=DEPTH, tcp_nodelay=True)
            self._publishers[row] = publisher, classes[row]
        for row in incoming:
            # without a queue nothing is dropped in silence: what is not read yet waits in the sender's socket
            self._subscribers.append(rospy.Subscriber(
                self._topic(row), classes[row], self._callback(row, receive), queue_size=None, tcp_nodelay=True))  # fmt: skip

        self._watcher = threading.Thread(target=self._watch, name="usv_gym master", daemon=True)
        self._watcher.start()

    def _watch(self) -> None:
        """Register again with a master that was away: a new one knows nobody, and rospy leaves it at that."""
        import rosgraph
        import rospy
        from rospy.topics import get_topic_manager  # type: ignore[import-not-found, unused-ignore]

        master = rosgraph.Master(rospy.get_name())
        known: Any = None
        while not self._closed.wait(1.0):
            try:
                pid = master.getPid()
                if known not in (None, pid):
                    self._counters["master was away"] += 1
                    topics, uri = get_topic_manager(), rospy.get_node_uri()
                    for each in list(topics.pubs.values()):
                        master.registerPublisher(each.resolved_name, each.type, uri)
                    for each in list(topics.subs.values()):
                        master.registerSubscriber(each.resolved_name, each.type, uri)
                known = pid
            except Exception:  # no master, or one that is just going: connections that stand do without
                continue

    def _topic(self, row: Row) -> str:
        return row.topic if row.topic.startswith("/") else f"{self._namespace}/{row.topic}"

    def _callback(self, row: Row, receive: Receive) -> Any:
        def heard(message: Any) -> None:
            try:
                values = read(message, message.__slots__, _TIME)
            except Exception as error:  # nothing that comes in may stop the connection
                self._counters[f"broken: {type(error).__name__}"] += 1
                return
            receive(row, values)

        return heard

    def publish(self, row: Row, message: Any) -> None:
        """Send one message."""
        publisher, cls = self._publishers[row]
        try:
            publisher.publish(fill(cls(), message, _TIME))
        except Exception as error:  # a value that does not fit its type, or a connection that just went
            self._counters[f"not sent: {row.topic}: {type(error).__name__}"] += 1

    def step(self) -> None:
        """Nothing to flush."""

    def peers(self) -> int:
        """Subscribers of the topic that has most."""
        return max((publisher.get_num_connections() for publisher, _ in self._publishers.values()), default=0)

    def counters(self) -> Mapping[str, int]:
        """What could not be read or sent."""
        return dict(self._counters)

    def close(self) -> None:
        """Leave the graph; a process has one ROS 1 node in its life."""
        if not self._publishers and not self._subscribers:
            return
        import rospy

        self._closed.set()
        self._publishers, self._subscribers = {}, []
        rospy.signal_shutdown("done")


def _rospy() -> Any:
    try:
        import rospy
    except ImportError:
        if DEBIAN not in sys.path and Path(DEBIAN, "rospy").is_dir():
            sys.path.append(DEBIAN)  # behind everything else, so that this environment's packages win
        try:
            import rospy
        except ImportError as error:
            raise ConfigError(f"backend ros1: {error}; source a ROS 1 installation, or sudo ros/ros1_apt.sh") from None
    return rospy


def message_class(kind: str, topic: str) -> Any:
    """A message class by type: a built one, else one that is generated from its definition.

    Raises
    ------
    ConfigError
        if there is neither.
    """
    from genpy.dynamic import generate_dynamic
    from genpy.message import get_message_class

    try:
        if (found := get_message_class(kind)) is not None:
            return found
    except (ImportError, ValueError):
        pass
    text = _definition(kind, topic)
    parts, seen, waiting = [text], {kind}, _used(text, kind)
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            inner = _definition(name, topic)
            parts.append(f"{'=' * 80}\nMSG: {name}\n{inner}")
            waiting += _used(inner, name)
    made = generate_dynamic(kind, "".join(part if part.endswith("\n") else f"{part}\n" for part in parts))
    for cls in made.values():
        cls.usv_gym_types = made
    return made[kind]


def _definition(kind: str, topic: str) -> str:
    package, _, name = kind.partition("/")
    for path in (ros() / package / "msg", *(share / package / "msg" for share in _DEFINITIONS)):
        if (path / f"{name}.msg").is_file():
            return (path / f"{name}.msg").read_text()
    raise ConfigError(f"{topic}: no ROS 1 message {kind}; is its package installed?")


_PRIMITIVES = {"bool", "byte", "char", "string", "time", "duration", "float32", "float64",
               *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}  # fmt: skip


def _used(text: str, kind: str) -> list[str]:
    """Message types that a definition uses, with their packages."""
    found = []
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if not words:
            continue
        name = words[0].partition("[")[0]
        if name in _PRIMITIVES:
            continue
        found.append(
            "std_msgs/Header" if name == "Header" else name if "/" in name else f"{kind.partition('/')[0]}/{name}"
        )
    return found
