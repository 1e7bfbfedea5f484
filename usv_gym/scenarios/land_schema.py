"""Schema of land in a scenario: where its polygons come from, and what the own ship's chart shows of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from ..config import Model, problem
from .places import Position
from .sensor_schema import Flag, NonNegative, Positive

Corners = Annotated[tuple[Position, ...], Field(min_length=3)]


class LandPolygon(Model):
    """A piece of land by its corners, with lakes."""

    shell: Corners
    holes: tuple[Corners, ...] = ()


def _shell_alone(value: Any) -> Any:
    return {"shell": value} if isinstance(value, list | tuple) else value


def _one_or_more(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


class Land(Model):
    """Land: polygons from files, from this file, from a world coastline; all of them together."""

    files: Annotated[tuple[str, ...], BeforeValidator(_one_or_more)] = Field(
        default=(), description="GeoJSON, Shapefile, GeoPackage, S-57 (.000, with its updates beside it)"
    )
    layer: str | None = Field(default=None, description="layer of the files; default: all that hold polygons")
    polygons: tuple[Annotated[LandPolygon, BeforeValidator(_shell_alone)], ...] = Field(
        default=(), description="each a list of corners, or {shell, holes}"
    )
    coast: Literal["auto"] | None = Field(default=None, description="auto: full-resolution GSHHG of the place")
    safety_depth: NonNegative = Field(default=0.0, description="[m] what may be shallower is land (S-57: DRVAL1 of DEPARE)")
    simplify: NonNegative = Field(default=2.0, description="[m] how far the coast may be moved to save corners; 0: not")
    radius: Positive | None = Field(
        default=None, description="half size [m] of the square around the origin that is kept; default: route and radar"
    )
    chart: Flag = Field(default=True, description="the own ship has a chart of this land")

    @field_validator("files")
    @classmethod
    def _files_exist(cls, value: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        directory = (info.context or {}).get("directory")
        found = []
        for name in value:
            candidates = [Path(directory) / name] if directory else []
            path = next((path for path in (*candidates, Path(name)) if path.is_file()), None)
            if path is None:
                raise problem(f"no such file: {name!r}")
            # what was relative to the scenario must still hold where it is used or dumped to
            found.append(str(path.resolve()))
        return tuple(found)

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not (self.files or self.polygons or self.coast):
            raise problem("give files, polygons or coast: auto")
        return self
