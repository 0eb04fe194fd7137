"""Data by others, not shipped: photographs and building files in ``../shared/data`` beside the repository."""

from __future__ import annotations

import os
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "shared" / "data"
SHOWN = "../shared/data"
VARIABLE = "HARVEY_DATA"
CORRIDOR = "corridor"
DUPLEX = "buildings/Ifc2x3_Duplex_Architecture.ifc"
MAP_PLANS = "maps/plans"


def data_path(name: str) -> Path:
    """Path of a file or folder, present or not: in the folder that HARVEY_DATA names, or beside the repository."""
    return Path(os.environ.get(VARIABLE, FOLDER)) / name


def describe_absence(name: str) -> str:
    """Sentence for reports without this data."""
    return f"{name} is not in {os.environ.get(VARIABLE, SHOWN)}; {VARIABLE}=FOLDER names another folder"
