"""Names and places, as all of a scenario writes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, Discriminator, Field, Tag

from ..config import Model, problem
from .sensor_schema import Number

Latitude = Annotated[float, Field(strict=True, ge=-90, le=90)]
Longitude = Annotated[float, Field(strict=True, ge=-180, le=180)]
Direction = Annotated[float, Field(strict=True, ge=-360, le=360)]


def _name(value: str) -> str:
    if not value or value != value.strip() or not value.isprintable() or set(".=") & set(value):
        raise problem("expected a name without '.' and '=' (overrides need them) and without spaces at its ends")
    return value


Name = Annotated[str, AfterValidator(_name)]


class GeoPoint(Model):
    """A place on the globe, WGS-84."""

    latitude_deg: Latitude
    longitude_deg: Longitude


def _kind_of_place(value: Any) -> str | None:
    if isinstance(value, GeoPoint | Mapping):
        return "geo"
    return "local" if isinstance(value, list | tuple) and len(value) == 2 else None


Position = Annotated[
    Annotated[tuple[Number, Number], Tag("local")] | Annotated[GeoPoint, Tag("geo")],
    Discriminator(
        _kind_of_place,
        custom_error_type="place",
        custom_error_message="expected [north, east] in metres or {latitude_deg, longitude_deg}",
    ),
]


class Origin(Model):
    """Where {n} touches the earth."""

    latitude_deg: Annotated[float, Field(strict=True, ge=-89, le=89)]
    longitude_deg: Longitude
