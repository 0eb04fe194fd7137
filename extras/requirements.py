"""What the tests need besides the core, for ``make lock``: optional packages, and those of the extras, one a line."""

import sys
import tomllib
from pathlib import Path

EXTRAS = Path(__file__).parent


def list_requirements() -> list[str]:
    """The optional requirements of the core, and all of the extras but the core itself."""
    projects = [tomllib.loads(path.read_text(encoding="utf-8"))["project"]
                for path in (EXTRAS.parent / "pyproject.toml", *sorted(EXTRAS.glob("*/pyproject.toml")))]
    optional = [name for project in projects for group in project.get("optional-dependencies", {}).values()
                for name in group]
    return optional + [name for project in projects[1:] for name in project["dependencies"] if name != "harvey"]


if __name__ == "__main__":
    sys.stdout.write("\n".join(list_requirements()) + "\n")
