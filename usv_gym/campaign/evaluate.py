"""Fly a campaign into a directory, and leave its results as Parquet, JSON and a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..config import ConfigError
from ..replay.archive import plain, replacing
from .flight import Result
from .plan import Campaign, Journal, in_order
from .runner import Fleet, flights
from .summary import summarise

#: (episodes done, in all, the result that is new)
Progress = Callable[[int, int, Result | None], None]


def fly(campaign: Campaign, directory: Path, *, workers: int | None = None, progress: Progress | None = None) -> Journal:
    """Fly what is left of a campaign; every row is on disk when it is known.

    Raises
    ------
    ConfigError
        if the directory holds something else.
    """
    journal = Journal(directory, campaign)
    left = list(campaign.flights(journal.done))
    total = sum(len(flight.seeds) for flight in left)
    done = 0
    if progress is not None:
        progress(0, total, None)
    if left:
        with journal.writing() as write, Fleet(workers) as fleet:
            for result in fleet.fly(piece for flight in left for piece in flights(flight)):
                write(result)
                done += 1
                if progress is not None:
                    progress(done, total, result)
    return journal


def write_results(journal: Journal, *, accept: float | None = None) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Leave ``episodes.parquet``, ``encounters.parquet`` and ``summary.json``; returns the sorted rows and the summary."""
    rows = in_order(journal.meta, journal.rows)
    summary = plain(summarise(journal.meta, rows, accept))
    try:
        write_parquet(rows, journal.meta, journal.directory)
        with replacing(journal.directory / "summary.json") as file:
            file.write(json.dumps({**summary, "campaign": journal.meta}, indent=1).encode() + b"\n")
    except OSError as error:
        raise ConfigError(f"{journal.directory}: cannot be written: {error.strerror or error}") from None
    return rows, summary


def write_parquet(rows: Sequence[Mapping[str, Any]], meta: Mapping[str, Any], directory: Path) -> None:
    """Episodes and encounters as one table each; what they were made of stands in the schema under ``usv_gym``."""
    pa, pq = arrow()
    episodes = [{key: value for key, value in row.items() if key != "encounters"} for row in rows]
    encounters = [{"policy": row["policy"], "case": row["case"], "seed": row["seed"], **e} for row in rows
                  for e in row["encounters"]]  # fmt: skip
    for name, table in (("episodes", episodes), ("encounters", encounters)):
        keys = list(dict.fromkeys(key for row in table for key in row))
        columns = {key: pa.array([row.get(key) for row in table]) for key in keys}
        made = pa.table(columns).replace_schema_metadata({"usv_gym": json.dumps(meta)})
        with replacing(directory / f"{name}.parquet") as file:
            pq.write_table(made, file, compression="zstd")


def arrow() -> tuple[Any, Any]:
    """pyarrow and its Parquet module.

    Raises
    ------
    ConfigError
        if they are not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise ConfigError(f"campaigns write Parquet ({error}): pip install 'usv-gym[campaign]'") from None
    return pa, pq
