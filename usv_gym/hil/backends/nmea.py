"""NMEA 0183 over UDP and TCP: what chart plotters, AIS receivers and autopilots speak.

One thread reads all sockets.  Whatever arrives is cut into lines of at most ``LINE`` bytes, must be ASCII and bear the right
checksum; the rest is counted and forgotten.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from ...config import ConfigError
from ..profile import Row
from . import Receive
from .nmea_fields import checksum, sentence_encoder

LINE = 1024  #: bytes of a line
BURST = 256  #: datagrams that are read in one go
BACKLOG = 1 << 18  #: bytes that may wait for a slow TCP client before it is let go
CLIENTS = 16


class Nmea:
    """Sentences out by UDP to ``to`` and by TCP to the clients of ``tcp``; in by UDP at ``listen`` and from the clients."""

    name = "nmea"
    max_rate = 1000.0
    OPTIONS: ClassVar[dict[str, str]] = {
        "to": "HOST:PORT[,HOST:PORT..] for UDP; off",
        "listen": "HOST:PORT of UDP for commands; off",
        "tcp": "HOST:PORT of a TCP server for both ways; off",
    }

    def __init__(self, to: str = "127.0.0.1:10110", listen: str = "127.0.0.1:10111", tcp: str = "off") -> None:
        """Read the addresses; nothing is opened yet."""
        self.to = [] if to == "off" else [address(part, "to") for part in to.split(",")]
        self.listen = None if listen == "off" else address(listen, "listen")
        self.tcp = None if tcp == "off" else address(tcp, "tcp")
        self._counters: Counter[str] = Counter()
        self._clients: dict[socket.socket, bytearray] = {}  # what waits to be sent
        self._partial: dict[socket.socket, bytearray] = {}  # of a line
        self._lock = threading.Lock()
        self._running = False

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Bind the sockets and start to read."""
        self._receive = receive
        self._encode = {row: sentence_encoder(row) for row in out if isinstance(row.fields, list | tuple)}
        self._rows: dict[str, list[Row]] = {}
        for row in incoming:
            self._rows.setdefault(
                row.type[-3:] if len(row.type) == 5 and row.type[:2] == "--" else row.type, []
            ).append(row)
        self._selector = selectors.DefaultSelector()
        self._udp_out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp_out.setblocking(False)
        self._sockets = [self._udp_out]
        if self.listen:
            self._bind(socket.SOCK_DGRAM, self.listen, "listen")
        if self.tcp:
            self._bind(socket.SOCK_STREAM, self.tcp, "tcp").listen(CLIENTS)
        self._wake, waker = socket.socketpair()
        self._sockets += [self._wake, waker]
        self._selector.register(waker, selectors.EVENT_READ, "wake")
        self._running = True
        self._thread = threading.Thread(target=self._read, name="usv_gym nmea", daemon=True)
        self._thread.start()

    def _bind(self, kind: socket.SocketKind, where: tuple[str, int], option: str) -> socket.socket:
        made = socket.socket(socket.AF_INET, kind)
        self._sockets.append(made)
        if kind == socket.SOCK_STREAM:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.setblocking(False)
        try:
            made.bind(where)
        except OSError as error:
            for each in self._sockets:
                each.close()
            raise ConfigError(f"nmea {option}={where[0]}:{where[1]}: {error.strerror or error}") from None
        self._selector.register(made, selectors.EVENT_READ, "udp" if kind == socket.SOCK_DGRAM else "tcp")
        bound = made.getsockname()
        if kind == socket.SOCK_DGRAM:
            self.listen = bound
        else:
            self.tcp = bound
        return made

    # --- out ----------------------------------------------------------------------------------------------------------
    def publish(self, row: Row, message: Any) -> None:
        """Send the sentences of one message."""
        if not isinstance(row.fields, list | tuple):
            return
        lines = message["sentences"] if row.signal == "ais" else [self._encode[row](message)]
        for line in lines:
            data = line.encode("ascii", "replace") + b"\r\n"
            for where in self.to:
                try:
                    self._udp_out.sendto(data, where)
                except OSError:
                    self._count("not sent")
            if self._clients:
                self._send_tcp(data)

    def _send_tcp(self, data: bytes) -> None:
        with self._lock:
            for client, waiting in list(self._clients.items()):
                waiting += data
                try:
                    del waiting[: client.send(waiting)]
                except BlockingIOError:
                    pass
                except OSError:
                    self._drop(client)
                    continue
                if len(waiting) > BACKLOG:
                    self._counters["slow client dropped"] += 1
                    self._drop(client)

    def step(self) -> None:
        """Nothing to flush."""

    def peers(self) -> int:
        """Number of TCP clients; with UDP nobody knows."""
        return -1 if self.to else len(self._clients)

    def counters(self) -> Mapping[str, int]:
        """What was wrong with the lines that came."""
        return dict(self._counters)

    # --- in -----------------------------------------------------------------------------------------------------------
    def _read(self) -> None:
        while self._running:
            for key, _ in self._selector.select(timeout=0.5):
                made: Any = key.fileobj
                try:
                    if key.data == "udp":
                        self._read_datagrams(made)
                    elif key.data == "tcp":
                        self._accept(made)
                    elif key.data == "client":
                        self._read_client(made)
                    else:
                        made.recv(16)
                except OSError:
                    self._count("socket error")

    def _read_datagrams(self, made: socket.socket) -> None:
        for _ in range(BURST):
            try:
                data = made.recv(65536)
            except BlockingIOError:
                return
            for line in data.splitlines() or [b""]:
                self.line(line)
        time.sleep(0.001)  # a flood: let the world go on

    def _accept(self, made: socket.socket) -> None:
        client, _ = made.accept()
        client.setblocking(False)
        if len(self._clients) >= CLIENTS:
            self._count("too many clients")
            client.close()
            return
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with self._lock:
            self._clients[client] = bytearray()
        self._partial[client] = bytearray()
        self._selector.register(client, selectors.EVENT_READ, "client")

    def _read_client(self, client: socket.socket) -> None:
        try:
            data = client.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            with self._lock:
                self._drop(client)
            return
        buffer = self._partial.get(client)
        if buffer is None:
            return
        buffer += data
        *lines, rest = buffer.split(b"\n")
        for line in lines:
            self.line(bytes(line))
        buffer[:] = rest if len(rest) <= LINE else rest[: LINE + 1]  # of a line that is too long the beginning will do
        if len(data) == 65536:
            time.sleep(0.001)

    def _drop(self, client: socket.socket) -> None:
        self._clients.pop(client, None)
        self._partial.pop(client, None)
        with contextlib.suppress(KeyError, ValueError):
            self._selector.unregister(client)
        client.close()

    def line(self, line: bytes) -> None:
        """Take one line in."""
        line = line.strip(b"\r\n \0")
        if not line:
            return
        reason = self._take(line)
        self._count(reason or "accepted")

    def _take(self, line: bytes) -> str:
        if len(line) > LINE:
            return "line too long"
        if line[:1] == b"\\":  # a TAG block
            line = line[line.find(b"\\", 1) + 1 :]
        try:
            text = line.decode("ascii")
        except UnicodeDecodeError:
            return "not ASCII"
        if text[:1] not in ("$", "!"):
            return "not a sentence"
        body, star, given = text[1:].partition("*")
        if not star:
            return "no checksum"
        try:
            good = len(given) == 2 and int(given, 16) == checksum(body)
        except ValueError:
            good = False
        if not good:
            return "wrong checksum"
        kind, *fields = body.split(",")
        rows = self._rows.get(kind) or self._rows.get(kind[2:] if len(kind) == 5 else "")
        if not rows:
            return "unknown sentence"
        for row in rows:
            self._receive(row, fields)
        return ""

    def _count(self, reason: str) -> None:
        with self._lock:
            self._counters[reason] += 1

    def close(self) -> None:
        """Stop reading and close all sockets."""
        if not self._running:
            return
        self._running = False
        with contextlib.suppress(OSError):
            self._wake.send(b"x")
        self._thread.join(timeout=2.0)
        for each in [*self._sockets, *self._clients]:
            each.close()
        self._selector.close()


def address(text: str, option: str) -> tuple[str, int]:
    """HOST:PORT.

    Raises
    ------
    ConfigError
        if it is none.
    """
    host, colon, port = text.strip().rpartition(":")
    if not colon or not port.isdecimal() or int(port) > 65535:
        raise ConfigError(f"nmea {option}={text}: expected HOST:PORT, as 127.0.0.1:10110")
    return (host or "127.0.0.1"), int(port)
