"""AIS history as NMEA 0183 sentences, decoded by pyais.

AIVDM says nothing about the hour, so a clock is needed: the receiver's time in a tag block (``\\c:1311678000*..\\``) or in a
Gatehouse wrapper (``$PGHP``) belongs to its own sentence; the receiver's GPS (RMC, ZDA) sets a clock for those that follow.
A position report carries the UTC second of its fix: with it a time that is good to a few seconds becomes the time of the fix.

Loggers write what the standard does not know.  What can be decoded all the same is used; all of it is counted.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...config import ConfigError
from .csv_files import opened
from .fixes import NAN, Harvest, Progress, is_ship

_SENTENCE = re.compile(rb"[!$][A-Z\-]{2}[A-Z]{2,3}[0-9A-Z]?,[^!$*\\]*\*[0-9A-F]{2}$", re.IGNORECASE)
_PATIENCE = 10_000  #: position reports that wait for the first clock
_CLOCKS = "expected tag blocks with c:, or RMC, ZDA or $PGHP sentences"
_EVERY = 5_000  #: lines between two reports of progress
_LATE, _EARLY = 10.0, 5.0  #: [s] a receiver's clock may be behind or ahead of a fix whose second is told
#: messages that are used: positions of class A and B, particulars
_POSITION_A, _POSITION_B, _STATIC = (1, 2, 3), (18, 19), (5, 19, 24)
_SHIP_MESSAGES = {*_POSITION_A, *_POSITION_B, *_STATIC}


class _Clock:
    """UTC [s since 1970] of what comes next; NaN while unknown."""

    def __init__(self) -> None:
        self.sentence = NAN  # told for the next AIS sentence only
        self.running = NAN  # told by the GPS

    def take(self) -> float:
        t = self.sentence if self.sentence == self.sentence else self.running
        self.sentence = NAN
        return t


def looks_like_nmea(start: bytes) -> bool:
    """True if a file that starts like this holds sentences."""
    return start.lstrip()[:1] in (b"!", b"$", b"\\")


def read_nmea(path: Path, harvest: Harvest, progress: Progress | None = None) -> None:
    """Stream a log into a harvest; positions of the receiver itself (RMC, AIVDO) go to ``harvest.own``.

    Raises
    ------
    ConfigError
        if the file cannot be read, or nothing in it tells the time.
    """
    from pyais.exceptions import AISBaseException
    from pyais.messages import NMEASentenceFactory

    odd, clock = harvest.odd, _Clock()
    fragments: dict[Any, list[Any]] = {}
    waiting: list[tuple[Any, bool]] = []  # reports from before the first clock
    size = path.stat().st_size if path.is_file() else 0
    with opened(path) as (raw, tell):
        for count, line in enumerate(raw):
            harvest.lines += 1
            if count % _EVERY == 0 and progress is not None:
                progress(tell(), size)
            line = line.strip()
            if not line:
                continue
            tag, _, body = line[1:].partition(b"\\") if line[:1] == b"\\" else (b"", b"", line)
            if tag:
                stamp = _tag_time(tag)
                if stamp == stamp:
                    clock.sentence = stamp
            if body[3:6] not in (b"VDM", b"VDO"):
                if body:
                    _look_at_clock(body, clock, harvest)
                continue
            if body.count(b",") != 6:
                odd["AIS sentences with a field too many or too few"] += 1
            try:
                sentence: Any = NMEASentenceFactory.produce(body)
                if not sentence.is_valid:
                    odd["AIS sentences with a wrong checksum"] += 1
                    clock.sentence = NAN
                    continue
                if sentence.frag_cnt > 1:
                    sentence = _joined(sentence, fragments)
                    if sentence is None:
                        continue
                own = body[3:6] == b"VDO"
                t = clock.take()
                if sentence.ais_id not in _SHIP_MESSAGES:
                    continue
                message = sentence.decode()
            except (AISBaseException, ValueError, IndexError, KeyError, TypeError) as error:
                odd[f"AIS sentences that cannot be decoded ({type(error).__name__})"] += 1
                clock.sentence = NAN
                continue
            if t != t and sentence.ais_id not in (5, 24):
                waiting.append((message, own))
                if len(waiting) > _PATIENCE:
                    raise ConfigError(f"{path}: no time in the first {len(waiting):,} position reports: {_CLOCKS}")
                continue
            while waiting and t == t:
                _use(*waiting.pop(0), t, harvest)
            _use(message, own, t, harvest)
    if fragments:
        odd["AIS messages with a part missing"] += len(fragments)
    if waiting:
        raise ConfigError(f"{path}: no time for its {len(waiting):,} position reports: {_CLOCKS}")


def _joined(part: Any, fragments: dict[Any, list[Any]]) -> Any:
    """A message from its parts; None while one is missing."""
    key = part.seq_id, part.channel, part.talker_id, part.type, part.frag_cnt
    parts = [] if part.frag_num == 1 else fragments.get(key, [])
    if len(parts) != part.frag_num - 1:
        return None
    parts.append(part)
    fragments[key] = parts
    if len(parts) < part.frag_cnt:
        return None
    del fragments[key]
    return part.assemble_from_iterable(parts)


def _tag_time(tag: bytes) -> float:
    """Receiver's time in a tag block [s]; some write milliseconds."""
    for field in tag.split(b"*")[0].split(b","):
        if field[:2] == b"c:":
            try:
                stamp = float(field[2:])
            except ValueError:
                return NAN
            return stamp / 1000.0 if stamp > 1e11 else stamp
    return NAN


def _look_at_clock(body: bytes, clock: _Clock, harvest: Harvest) -> None:
    """Take time and own position from a sentence that is not AIS."""
    kind = body[3:6]
    if not _SENTENCE.match(body):
        harvest.odd["sentences that are no NMEA 0183"] += 1
        return
    field = body.split(b"*")[0].split(b",")
    try:
        if kind == b"RMC" and field[2] == b"A":
            clock.running = _utc(field[1], field[9][4:6], field[9][2:4], field[9][:2])
            place = (_angle(field[3], field[4]), _angle(field[5], field[6]))
            sog, cog = (float(text or NAN) for text in field[7:9])
            harvest.add_own(clock.running, *place, sog, cog, NAN)
        elif kind == b"ZDA":
            clock.running = _utc(field[1], field[4][-2:], field[3], field[2])
        elif body[:5] == b"$PGHP" and field[1] == b"1":
            numbers = [int(part) for part in field[2:9]]
            numbers[6] *= 1000
            clock.sentence = datetime(*numbers, tzinfo=UTC).timestamp()  # type: ignore[arg-type, misc]
    except (ValueError, IndexError):
        harvest.odd["clock sentences that cannot be read"] += 1


def _utc(hms: bytes, year: bytes, month: bytes, day: bytes) -> float:
    midnight = datetime(2000 + int(year), int(month), int(day), tzinfo=UTC).timestamp()
    return midnight + 3600 * int(hms[:2]) + 60 * int(hms[2:4]) + float(hms[4:])


def _angle(text: bytes, side: bytes) -> float:
    """Degrees from ``dddmm.mmmm`` and N, S, E or W."""
    whole, minutes = divmod(float(text), 100.0)
    return (whole + minutes / 60.0) * (-1.0 if side in (b"S", b"W") else 1.0)


def time_of_fix(received: float, second: int) -> float:
    """When a fix was made [s since 1970], from the receiver's clock and the UTC second that the report carries.

    60 and more mean that there is none; a second that is far from the receiver's clock is a late message or a wrong clock on
    board, and is not followed.
    """
    if second > 59:
        return received
    late = (received - second + _EARLY) % 60.0 - _EARLY
    return received - late if late <= _LATE else received


def _use(message: Any, own: bool, t: float, harvest: Harvest) -> None:
    """Put a decoded message into the harvest."""
    kind, mmsi = message.msg_type, int(message.mmsi)
    if kind in _POSITION_A or kind in _POSITION_B:
        t = time_of_fix(t, message.second)
        fix = t, message.lat, message.lon, message.speed, message.course, message.heading
        if own:
            harvest.add_own(*fix)
        elif not is_ship(mmsi):
            harvest.odd["position reports of stations that are no ships"] += 1
        elif harvest.add(mmsi, *fix):
            harvest.about(mmsi).update(ais_class="A" if kind in _POSITION_A else "B")
    if kind in _STATIC and not own:
        size = getattr(message, "to_bow", 0) + getattr(message, "to_stern", 0)
        beam = getattr(message, "to_port", 0) + getattr(message, "to_starboard", 0)
        name = str(getattr(message, "shipname", "") or "").strip()
        if name or size:
            harvest.about(mmsi).update(name, float(size), float(beam))
