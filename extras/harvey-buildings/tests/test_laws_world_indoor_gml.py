"""The law of IndoorGML's dialects: the same building, written in another way, is imported as the same rooms."""

import math
from dataclasses import dataclass
from pathlib import Path

import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harvey_buildings import import_building, read_plan
from world_models.building.checks import check_world
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

CORNERS = {"hall": (0.0, 0.0, 9.0, 3.0), "office": (0.0, 3.2, 4.0, 7.2), "store": (4.2, 3.2, 9.0, 7.2)}
"""x0, y0, x1, y1 of three rooms on a floor [m]."""
DOORS = (("hall", "office", (2.0, 3.0), (2.9, 3.0)), ("hall", "store", (6.0, 3.0), (6.9, 3.0)))
HEIGHT_M, DOOR_HEIGHT_M = 2.8, 2.1


@dataclass(frozen=True)
class Dialect:
    """How a program writes the file."""

    space: str = "CellSpace"
    version: int = 1
    is_closed: bool = True
    with_list: bool = False
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_rad: float = 0.0
    wobble_m: float = 0.0
    names_cells: bool = False
    by_link: bool = False
    id_prefix: str = "g:"
    unit_m: float = 1.0

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        placed = (c * x - s * y + self.at[0], s * x + c * y + self.at[1], z + self.at[2])
        return placed[0] / self.unit_m, placed[1] / self.unit_m, placed[2] / self.unit_m

    def ring(self, points: list[tuple[float, float, float]]) -> str:
        placed = [self.point(*p) for p in points]
        placed += placed[:1] * self.is_closed
        words = [" ".join(f"{value:.6f}" for value in p) for p in placed]
        if self.with_list:
            return f"<g:LinearRing><g:posList srsDimension='3'>{' '.join(words)}</g:posList></g:LinearRing>"
        return f"<g:LinearRing>{''.join(f'<g:pos>{word}</g:pos>' for word in words)}</g:LinearRing>"

    def polygon(self, points: list[tuple[float, float, float]], name: str = "") -> str:
        named = f' {self.id_prefix}id="{name}"' * bool(name)
        return f"<g:Polygon{named}><g:exterior>{self.ring(points)}</g:exterior></g:Polygon>"

    def cell(self, name: str) -> tuple[str, str]:
        """The cell, and what stands elsewhere in the file of it."""
        x0, y0, x1, y1 = CORNERS[name]
        around = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        floor = [(x, y, self.wobble_m * (k % 2)) for k, (x, y) in enumerate(around)]
        faces = [floor, [(x, y, HEIGHT_M) for x, y in reversed(around)]]
        faces += [[(*around[k - 1], 0.0), (*around[k], 0.0), (*around[k], HEIGHT_M), (*around[k - 1], HEIGHT_M)]
                  for k in range(4)]
        polygons = [self.polygon(face, f"{name}-{k}") for k, face in enumerate(faces)]
        members = "".join(f'<g:surfaceMember x:href="#{name}-{k}"/>' if self.by_link else
                          f"<g:surfaceMember>{p}</g:surfaceMember>" for k, p in enumerate(polygons))
        text = (f'<c:cellSpaceMember><n:{self.space} {self.id_prefix}id="{name}"><g:name>{name}</g:name>'
                f"<c:cellSpaceGeometry><c:Geometry3D><g:Solid><g:exterior><g:Shell>{members}</g:Shell></g:exterior>"
                f"</g:Solid></c:Geometry3D></c:cellSpaceGeometry></n:{self.space}></c:cellSpaceMember>")
        return text, "".join(polygons) * self.by_link

    def boundary(self, number: int) -> str:
        (xa, ya), (xb, yb) = DOORS[number][2:]
        door = self.polygon([(xa, ya, 0.0), (xb, yb, 0.0), (xb, yb, DOOR_HEIGHT_M), (xa, ya, DOOR_HEIGHT_M)])
        return (f'<c:cellSpaceBoundaryMember><c:CellSpaceBoundary {self.id_prefix}id="B{number}">'
                f'<c:duality x:href="#T{number}"/><c:geometry3D>{door}</c:geometry3D></c:CellSpaceBoundary>'
                "</c:cellSpaceBoundaryMember>")

    def text(self) -> str:
        node, edge, layer = (("State", "Transition", "SpaceLayer") if self.version == 1
                             else ("Node", "Edge", "DualSpaceLayer"))
        cells = [self.cell(name) for name in CORNERS]
        nodes, edges = "", ""
        for name, (x0, y0, x1, y1) in CORNERS.items():
            at = " ".join(f"{value:.6f}" for value in self.point((x0 + x1) / 2, (y0 + y1) / 2, 1.0))
            nodes += (f'<c:{node} {self.id_prefix}id="S{name}"><c:duality x:href="#{name}"/><c:geometry><g:Point>'
                      f"<g:pos>{at}</g:pos></g:Point></c:geometry></c:{node}>")
        for number, (a, b, *_) in enumerate(DOORS):
            mark = "" if self.names_cells else "S"
            ends = "".join(f'<c:connects x:href="#{mark}{room}"/>' for room in (a, b))
            edges += f'<c:{edge} {self.id_prefix}id="T{number}"><c:weight>1</c:weight>{ends}</c:{edge}>'
        boundaries = "".join(self.boundary(number) for number in range(len(DOORS)))
        return (
            '<?xml version="1.0"?><c:IndoorFeatures xmlns:c="http://www.opengis.net/indoorgml/core" xmlns:n="navi" '
            'xmlns:g="http://www.opengis.net/gml/3.2" xmlns:x="http://www.w3.org/1999/xlink">'
            f"<c:primalSpaceFeatures>{''.join(cell for cell, _ in cells)}{boundaries}</c:primalSpaceFeatures>"
            f"<c:layers><c:{layer}>{nodes}{edges}</c:{layer}></c:layers><c:shapes>{''.join(s for _, s in cells)}"
            "</c:shapes></c:IndoorFeatures>"
        )


DIALECTS = st.builds(
    Dialect,
    space=st.sampled_from(["CellSpace", "GeneralSpace", "TransitionSpace", "NavigableSpace"]),
    version=st.sampled_from([1, 2]),
    is_closed=st.booleans(),
    with_list=st.booleans(),
    at=st.sampled_from([(0.0, 0.0, 0.0), (-30.0, 12.0, 3.5), (445_538.0, 5_444_903.0, 112.4)]),
    turn_rad=st.floats(-0.7, 0.7),
    wobble_m=st.sampled_from([0.0, 0.001, 0.02]),
    names_cells=st.booleans(),
    by_link=st.booleans(),
    id_prefix=st.sampled_from(["g:", ""]),
)
LAW = settings(max_examples=60, deadline=None, derandomize=True,
               suppress_health_check=[HealthCheck.function_scoped_fixture])


def _areas_m2(path: Path) -> list[float]:
    plan, _ = read_plan(path)
    return sorted(shapely.Polygon(space.outline).area for space in plan.spaces)


@LAW
@given(dialect=DIALECTS)
def test_the_same_building_in_another_dialect_has_the_same_rooms_and_doors(tmp_path: Path, dialect: Dialect) -> None:
    path = tmp_path / "building.gml"
    path.write_text(dialect.text(), encoding="utf-8")
    assert _areas_m2(path) == pytest.approx([16.0, 19.2, 27.0], rel=0.01)
    made = import_building(path)
    world = read_world(Source.parse(made.text))
    assert check_world(world) == []
    assert len(world.rooms) == 3
    widths_m = sorted(doorway.width_m for doorway in world.doorways)
    assert widths_m == pytest.approx([0.9, 0.9], abs=0.06)
    assert made.network is not None and made.network.graph.number_of_edges() == len(DOORS)
    lengths = sorted(length for *_, length in made.network.graph.edges(data="length_m"))
    assert lengths == pytest.approx(sorted([math.hypot(2.5, 3.7), math.hypot(2.1, 3.7)]), abs=0.01)


@pytest.mark.parametrize("unit_m", [0.0254, 0.1, 0.3])
def test_a_unit_that_is_not_the_metre_is_told_by_its_doors(tmp_path: Path, unit_m: float) -> None:
    path = tmp_path / "building.gml"
    path.write_text(Dialect(unit_m=unit_m).text(), encoding="utf-8")
    assert _areas_m2(path) == pytest.approx([16.0, 19.2, 27.0], rel=0.01)
    assert any("not the metre" in line for line in import_building(path).report.guessed)


def test_walls_and_doors_that_are_cells_are_no_rooms(tmp_path: Path) -> None:
    dialect = Dialect()
    wall = dialect.cell("office")[0].replace("office", "wall-1")
    path = tmp_path / "building.gml"
    text = dialect.text().replace("<c:primalSpaceFeatures>", f"<c:primalSpaceFeatures>{wall}")
    path.write_text(text, encoding="utf-8")
    assert {space.name for space in read_plan(path)[0].spaces} == set(CORNERS)
