"""Real building files, made by others, where they are beside the repository."""

from __future__ import annotations

import os
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "buildings"
SHOWN = "../shared/data/buildings"
VARIABLE = "HARVEY_BUILDINGS"
DUPLEX, UNIVERSITY = "Ifc2x3_Duplex_Architecture.ifc", "pnu_abc.gml"


def building_file(name: str) -> Path:
    """Where a building file would be: in the folder that the environment names, or beside the repository."""
    return Path(os.environ.get(VARIABLE, FOLDER)) / name


def where_it_should_be(name: str) -> str:
    """What to say where it is absent."""
    return f"{name} is not in {os.environ.get(VARIABLE, SHOWN)}; {VARIABLE}=FOLDER names another folder"
