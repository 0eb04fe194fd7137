"""The lock files pin all that they bring: what somebody else releases tomorrow changes no environment."""

import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[3]
LOCKS = ("requirements-pip.lock", "requirements.lock", "requirements-dev.lock")


def read_lock(name: str) -> list[Requirement]:
    """The requirements of one lock file, without their hashes."""
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    return [Requirement(line.rstrip(" \\")) for line in lines if re.match(r"[A-Za-z0-9]", line)]


LOCKED = {(canonicalize_name(pin.name)): pin for name in LOCKS for pin in read_lock(name)}


def needs_of(pin: Requirement) -> list[Requirement]:
    """What an installed package says that it needs here, with the extras with which it is locked."""
    environment = default_environment()
    needs = [Requirement(text) for text in distribution(pin.name).requires or ()]
    return [need for need in needs
            if need.marker is None or any(need.marker.evaluate({**environment, "extra": extra})
                                          for extra in {"", *pin.extras})]


@pytest.mark.parametrize("name", sorted(LOCKED))
def test_all_that_a_locked_package_needs_is_pinned_with_its_extras(name: str) -> None:
    """pip with hashes refuses ``coverage[toml]>=7.10`` beside ``coverage==7.17.3`` as soon as a newer one is out."""
    try:
        needs = needs_of(LOCKED[name])
    except PackageNotFoundError:
        pytest.skip(f"{name} is not installed")
    for need in needs:
        pin = LOCKED.get(canonicalize_name(need.name))
        assert pin is not None, f"{name} needs {need}, which no lock file pins"
        (version,) = [specifier.version for specifier in pin.specifier]
        assert need.specifier.contains(version, prereleases=True), f"{name} needs {need}, and {pin} is locked"
        assert need.extras <= pin.extras, f"{name} needs {need}, and {pin} is locked without its extras"


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_file_pins_each_version_with_hashes_and_names_no_host(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert "://" not in text and "--index" not in text and "--find-links" not in text
    for pin in read_lock(name):
        assert [specifier.operator for specifier in pin.specifier] == ["=="], pin
        assert re.search(rf"^{re.escape(str(pin))} \\\n    --hash=sha256:", text, re.MULTILINE), pin


def test_pip_itself_is_pinned_to_what_the_makefile_says() -> None:
    (version,) = re.findall(r"^PIP_VERSION := (\S+)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert str(LOCKED["pip"]) == f"pip=={version}"
