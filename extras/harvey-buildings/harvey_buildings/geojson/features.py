"""The features of a GeoJSON file (RFC 7946), checked, in metres on the plan."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from harvey_buildings.building_plan import BuildingError, Floats
from harvey_buildings.polygons import MAX_COORDINATE_M

MAX_BYTES = 100_000_000
EARTH_RADIUS_M = 6_371_008.8
"""Mean radius (IUGG)."""
BESIDE = ("unit", "opening", "level")
"""The files of an IMDF archive that are read together."""


@dataclass(frozen=True, eq=False, slots=True)
class Feature:
    """One feature.

    Attributes:
        id: of the feature, or empty.
        kind: room, doorway, thing, link (``feature`` of our own files), or unit, opening, level (IMDF's).
        geometry: on the plan [m]; None where the file has none.
        properties: as in the file.
    """

    id: str
    kind: str
    geometry: shapely.Geometry | None
    properties: Mapping[str, Any]

    def number(self, key: str, otherwise: float, low: float, high: float) -> float:
        """A property that is a number from ``low`` to ``high``, or else ``otherwise``."""
        value = self.properties.get(key)
        return float(value) if isinstance(value, int | float) and low <= value <= high else otherwise

    def names(self, key: str) -> tuple[str, ...]:
        """A property that is a list of names."""
        value = self.properties.get(key)
        return tuple(item for item in value if isinstance(item, str)) if isinstance(value, list) else ()

    @property
    def label(self) -> str:
        """Its name: a text, or IMDF's by language; its id where it has none."""
        name = self.properties.get("name")
        if isinstance(name, dict):
            name = name.get("en") or next(iter(name.values()), None)
        return name if isinstance(name, str) and name else self.id


def read_features(path: Path) -> tuple[list[Feature], str]:
    """The features of a file, and of those of an IMDF archive beside it; where x, y came from. Raises BuildingError."""
    paths = [path]
    if path.stem in BESIDE:
        paths = [other for stem in BESIDE if (other := path.with_name(f"{stem}{path.suffix}")).is_file()]
    texts = [_read(each) for each in paths]
    is_metric = any(text.get("units") == "metres" for text in texts)
    features = [_feature(each, number, item) for each, text in zip(paths, texts, strict=True)
                for number, item in enumerate(text["features"], 1)]
    if not is_metric:
        features = _project(path, features)
    _expect_within(path, features, MAX_COORDINATE_M)
    return features, ("metres, as the file says" if is_metric else
                      "metres east and north of the south-west corner, from longitude and latitude")


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BuildingError(f"{path.name}: expected at most {MAX_BYTES} bytes, got {path.stat().st_size}")
        text = json.loads(path.read_bytes())
    except OSError as error:
        raise BuildingError(f"{path.name}: expected a file to read, got: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BuildingError(f"{path.name}: expected GeoJSON, got what is no JSON: {str(error)[:80]}") from None
    if not isinstance(text, dict) or text.get("type") != "FeatureCollection" or not isinstance(
            text.get("features"), list):
        raise BuildingError(f"{path.name}: expected a FeatureCollection with features, got none")
    return text


def _feature(path: Path, number: int, item: Any) -> Feature:
    if not isinstance(item, dict) or item.get("type") != "Feature":
        raise BuildingError(f"{path.name}: feature {number}: expected a Feature, got {str(item)[:60]!r}")
    said = item.get("properties")
    more: dict[str, Any] = said if isinstance(said, dict) else {}
    kind = more.get("feature") or item.get("feature_type") or ""
    geometry = None
    if item.get("geometry") is not None:
        try:
            geometry = shapely.from_geojson(json.dumps(item["geometry"]))
        except (shapely.GEOSException, ValueError) as error:
            raise BuildingError(f"{path.name}: feature {number}: expected a geometry, got {str(error)[:80]}") from None
        if not np.isfinite(shapely.get_coordinates(geometry)).all():
            raise BuildingError(f"{path.name}: feature {number}: expected finite coordinates, got others")
    return Feature(str(item.get("id", "")), kind if isinstance(kind, str) else "", geometry, more)


def _expect_within(path: Path, features: list[Feature], limit_m: float) -> None:
    for feature in features:
        if feature.geometry is not None and (np.abs(shapely.get_coordinates(feature.geometry)) > limit_m).any():
            raise BuildingError(f"{path.name}: {feature.label or 'a feature'}: expected coordinates up to "
                                f"{limit_m:g} m, got larger ones")


def _project(path: Path, features: list[Feature]) -> list[Feature]:
    """Longitude and latitude to metres: an equirectangular projection, good to millimetres on a building."""
    at = [shapely.get_coordinates(f.geometry) for f in features if f.geometry is not None]
    points = np.concatenate([np.zeros((0, 2)), *at])
    if not len(points):
        return features
    if np.abs(points).max(axis=0)[0] > 180.0 or np.abs(points).max(axis=0)[1] > 90.0:
        raise BuildingError(f'{path.name}: expected longitude and latitude in degrees, or "units": "metres" in the '
                            f"collection, got coordinates up to {np.abs(points).max():g}")
    low, middle = points.min(axis=0), float(points[:, 1].min() + points[:, 1].max()) / 2
    scale = math.radians(EARTH_RADIUS_M) * np.array([math.cos(math.radians(middle)), 1.0])

    def to_metres(xy: Floats) -> Floats:
        return np.asarray((xy - low) * scale)

    return [Feature(f.id, f.kind, None if f.geometry is None else shapely.transform(f.geometry, to_metres),
                    f.properties) for f in features]
