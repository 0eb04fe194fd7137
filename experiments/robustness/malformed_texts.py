"""Small valid files that use what the loader and the importers read: a world, an IndoorGML and an IFC building."""

from __future__ import annotations

SMALL = """\
name = "cottage"
units = "metres"

[finishes]
plain = { colour = [0.5, 0.5, 0.5], texture = "brick", scale = 0.2 }
oak = { colour = [0.55, 0.38, 0.22] }

[defaults]
height = 2.5
walls = "plain"
baseboard = "oak"
moulding = "oak"
frame = "oak"
leaf = "plain"
threshold = "oak"
door_width = 0.9
door_height = 2.0

[parts]
chest = [ { x = [-0.5, 0.5], y = [0.0, 0.5], z = [0.0, 1.0], finish = "plain", twin = false },
          { x = [-0.5, 0.5], y = [0.0, 0.1], z = [1.0, 2.0], finish = "oak", rim = "plain", rim_width = 0.1 } ]
panel = [ { x = [-0.2, 0.2], y = [0.0, 0.02], z = [1.0, 1.5], finish = "plain" } ]

[locales.ground]
kind = "floor"
survey = { sigma = 0.05, sigma_deg = 0.2 }

[locales.kitchen]
kind = "room"
in = "ground"
size = [4, 3]
walls = { south = "oak", east = "plain", north = "plain", west = "oak" }
properties = { owner = "Ann", seats = 4, warm = true }
things = [ { part = "chest", wall = "north", along = 1.0, name = "chest" },
           { part = "chest", at = [2, 1], turn = 90, finish = "oak" },
           { finish = "oak", wall = "west", along = 2, up = 1, boxes = [
               { x = [0, 0.3], y = [0, 0.1], z = [0, 0.3] } ] } ]

[locales.parlour]
kind = "room"
in = "ground"
at = [4.2, 0]
height = 3
outline = [[0, 0], [5, 0], [5, 2], [3, 2], [3, 3], [0, 3]]

[doors]
between-them = { between = ["kitchen", "parlour"], wall = "east", along = 1.5, open = true, width = 1 }
pantry = { between = ["kitchen"], wall = "south", along = 0.8, panel = "panel", leaf = "oak" }
"""


SQUARE = ((0, 0), (4, 0), (4, 3), (0, 3))


def _cell(name: str, x: float, z: float, corners: tuple[tuple[int, int], ...] = SQUARE) -> str:
    ring = "".join(f"<g:pos>{x + a} {b} {z}</g:pos>" for a, b in (*corners, corners[0]))
    return (f'<c:CellSpace g:id="{name}"><g:name>{name}</g:name><c:g><g:LinearRing>{ring}</g:LinearRing></c:g>'
            f'<c:duality x:href="#S{name}"/></c:CellSpace>')


def _state(name: str, x: float, z: float) -> str:
    return (f'<c:State g:id="S{name}"><c:duality x:href="#{name}"/><g:Point><g:pos>{x} 1.5 {z}</g:pos></g:Point>'
            "</c:State>")


def _way(a: str, b: str) -> str:
    return f'<c:Transition><c:connects x:href="#S{a}"/><c:connects x:href="#S{b}"/></c:Transition>'


GML = (
    '<c:IndoorFeatures xmlns:c="c" xmlns:g="http://www.opengis.net/gml/3.2" xmlns:x="http://www.w3.org/1999/xlink">'
    + _cell("Hall", 0, 0) + _cell("Room", 4.2, 0) + _cell("Door1", 4, 0, ((0, 1), (1, 1), (1, 2), (0, 2)))
    + _cell("Lift1", 8.2, 0) + _cell("Lift2", 8.2, 1) + "<c:SpaceLayer>"
    + _state("Hall", 2, 0) + _state("Door1", 4.1, 0) + _state("Room", 6, 0) + _state("Lift1", 10, 0)
    + _state("Lift2", 10, 1) + _way("Hall", "Door1") + _way("Door1", "Room") + _way("Room", "Lift1")
    + _way("Lift1", "Lift2") + "</c:SpaceLayer></c:IndoorFeatures>"
)


def _ifc_space(number: int, name: str, x: float) -> str:
    n = 100 * number
    return (
        f"#{n}=IFCCARTESIANPOINT(({x},0.,0.));\n#{n + 1}=IFCAXIS2PLACEMENT3D(#{n},$,$);\n"
        f"#{n + 2}=IFCLOCALPLACEMENT($,#{n + 1});\n#{n + 3}=IFCCARTESIANPOINT((2.,1.5));\n"
        f"#{n + 4}=IFCAXIS2PLACEMENT2D(#{n + 3},$);\n#{n + 5}=IFCRECTANGLEPROFILEDEF(.AREA.,$,#{n + 4},4.,3.);\n"
        f"#{n + 6}=IFCEXTRUDEDAREASOLID(#{n + 5},#8,#7,2.5);\n"
        f"#{n + 7}=IFCSHAPEREPRESENTATION(#9,'Body','SweptSolid',(#{n + 6}));\n"
        f"#{n + 8}=IFCPRODUCTDEFINITIONSHAPE($,$,(#{n + 7}));\n"
        f"#{n + 9}=IFCSPACE('{number:022d}',#6,'{name}',$,$,#{n + 2},#{n + 8},'Room',.ELEMENT.,.INTERNAL.,$);\n"
        f"#{n + 10}=IFCRELAGGREGATES('{number + 50:022d}',#6,$,$,#12,(#{n + 9}));\n"
    )


IFC = (
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    "FILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n"
    "#1=IFCPERSON($,$,'a',$,$,$,$,$);\n#2=IFCORGANIZATION($,'a',$,$,$);\n#3=IFCPERSONANDORGANIZATION(#1,#2,$);\n"
    "#4=IFCAPPLICATION(#2,'1','a','a');\n#5=IFCCARTESIANPOINT((0.,0.,0.));\n"
    "#6=IFCOWNERHISTORY(#3,#4,$,.ADDED.,$,$,$,0);\n#7=IFCDIRECTION((0.,0.,1.));\n#8=IFCAXIS2PLACEMENT3D(#5,$,$);\n"
    "#9=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#8,$);\n#10=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\n"
    "#11=IFCUNITASSIGNMENT((#10));\n"
    "#12=IFCBUILDINGSTOREY('0000000000000000000001',#6,'Ground',$,$,$,$,$,.ELEMENT.,0.);\n"
    "#13=IFCPROJECT('0000000000000000000002',#6,'p',$,$,$,$,(#9),#11);\n"
    + _ifc_space(1, "A", 0.0) + _ifc_space(2, "B", 4.0) + "ENDSEC;\nEND-ISO-10303-21;\n"
)
