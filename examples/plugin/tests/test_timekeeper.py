"""The timekeeper keeps the laws of all knowledge sources, and warns once, in time."""

from harvey_timekeeper.timekeeper import BATTERY_S, RunningShort, Timekeeper

from harvey.testing import Bench, check_source
from world_models.entries import MotionReport


def test_it_warns_once_when_half_of_the_battery_is_left() -> None:
    bench = Bench()
    late = bench.put(MotionReport(0.0, 0.5, 1.0, sim_time_s=12.0))
    effects = check_source(Timekeeper, bench, late)
    assert [effect.value for effect in effects] == [RunningShort(BATTERY_S - 12.0)]
    bench.apply(*effects)
    assert bench.ask(Timekeeper(), late) is None
