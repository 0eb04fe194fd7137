"""Messages: bytes as other code has them, whatever the values; whatever comes that is no message is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule
from ros2_values import USED, plain, random_message

from blackboard import Level
from harvey.testing import house, plain_robot
from harvey_ros2.messages.messages import MessageError, MessageTypes, dds_name, message_types, seconds, stamp
from harvey_ros2.messages.run_messages import RunMessages
from knowledge_sources.reads.place_believed import MAX_P_RIVAL
from world_models.entries import Certificate, Difference, Discrepancy, MilestoneVerdict, Rival
from world_models.entries.discrepancy import DiscrepancyStatus
from world_models.frames import Pose2

TYPES = message_types("jazzy")
VALUES = 1000


def test_a_message_is_built_from_its_definition_with_zeros_for_what_is_not_said() -> None:
    odom = TYPES.build("nav_msgs/msg/Odometry", header={"frame_id": "odom"}, pose={"pose": {"position": {"x": 1.5}}})
    assert (odom.header.frame_id, odom.pose.pose.position.x, odom.twist.twist.linear.x) == ("odom", 1.5, 0.0)
    assert odom.pose.covariance.shape == (36,) and odom.pose.covariance.dtype == np.float64
    again = TYPES.decode(TYPES.encode(odom), "nav_msgs/msg/Odometry")
    assert plain(again) == plain(odom)


def test_what_a_definition_lacks_is_refused() -> None:
    with pytest.raises(ValueError, match="expected its fields linear, angular, got 'speed'"):
        TYPES.build("geometry_msgs/msg/Twist", speed=1.0)
    with pytest.raises(ValueError, match="expected a message type of ROS 2 jazzy, got 'geometry_msgs/msg/Twits'"):
        TYPES.build("geometry_msgs/msg/Twits")
    with pytest.raises(ValueError, match="humble, jazzy, kilted, got 'noetic'"):
        MessageTypes("noetic")


def test_names_and_times() -> None:
    assert dds_name("geometry_msgs/msg/Twist") == "geometry_msgs::msg::dds_::Twist_"
    assert message_types("humble").hash_of("geometry_msgs/msg/Twist") == "TypeHashNotSupported"
    # The hash that ros2 topic info --verbose prints for this type, from Iron on.
    twist = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
    assert TYPES.hash_of("geometry_msgs/msg/Twist") == twist
    assert stamp(12.25) == {"sec": 12, "nanosec": 250_000_000}
    assert seconds(TYPES.build("builtin_interfaces/msg/Time", **stamp(1.8e9 + 0.125))) == 1.8e9 + 0.125


@pytest.mark.parametrize("name", USED)
def test_bytes_are_those_of_cyclonedds_for_random_values_both_ways(name: str) -> None:
    """Two programs that share no code: a class that cyclonedds codes by itself, and rosbags."""
    pytest.importorskip("cyclonedds")
    from harvey_ros2.messages.dds_middleware import build_idl_class

    theirs, rng = build_idl_class(TYPES, name), np.random.default_rng(1)
    values = VALUES if name != "visualization_msgs/msg/MarkerArray" else VALUES // 4  # its messages are long
    for _ in range(values):
        message = random_message(TYPES, name, rng)
        data = TYPES.encode(message)
        read = theirs.deserialize(data)
        assert plain(read) == plain(message)
        # The header of cyclonedds also says how many bytes pad the end.
        assert read.serialize()[4:].rstrip(b"\0") == data[4:].rstrip(b"\0")
        assert plain(TYPES.decode(read.serialize(), name)) == plain(message)


@settings(max_examples=300)
@given(name=st.sampled_from(USED), data=st.binary(max_size=200))
def test_bytes_that_are_no_message_are_refused_or_read_but_never_raise_anything_else(name: str, data: bytes) -> None:
    try:
        TYPES.decode(data, name)
    except MessageError as error:
        assert name in str(error)


@settings(max_examples=200)
@given(st.sampled_from(USED), st.integers(0, 10**9), st.data())
def test_a_message_cut_short_is_refused(name: str, seed: int, data: st.DataObject) -> None:
    whole = TYPES.encode(random_message(TYPES, name, np.random.default_rng(seed)))
    cut = data.draw(st.integers(0, len(whole) - 1))
    try:
        read = TYPES.decode(whole[:cut], name)
    except MessageError:
        return
    assert plain(read) == plain(TYPES.decode(whole, name))  # only padding was cut


class CertaintyMachine(RuleBasedStateMachine):
    """A place is told as certain where nothing spoke against it since a picture vouched for it, and no sense lies."""

    def __init__(self) -> None:
        super().__init__()
        robot = plain_robot()
        self.messages = RunMessages(TYPES, house(), robot.lens, robot.mount)
        self.is_certified = self.is_lost = self.is_misled = False

    @rule(verdict=st.sampled_from(("verified", "refuted", "not testable")), p_wrong=st.sampled_from((0.1, 0.49, 0.51)))
    def judge(self, verdict: MilestoneVerdict, p_wrong: float) -> None:
        said = Certificate("Milestone-1", "", verdict, "so", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0, 0.1, p_wrong, 0.5)
        is_kept = self.is_certified and verdict == "not testable" and p_wrong < 0.5
        self.is_certified = (is_kept or verdict == "verified") and not (self.is_lost or self.is_misled)
        self.agree(said)

    @rule(level=st.sampled_from((Level.PLAN, Level.GOAL)), status=st.sampled_from(("open", "corrected")))
    def doubt(self, level: Level, status: DiscrepancyStatus) -> None:
        if level is Level.GOAL:
            self.is_lost = status == "open"
            self.is_certified = self.is_certified and not self.is_lost
        self.agree(Discrepancy(level, "it is elsewhere", None, (5.0, 30.0), "px", status))

    @rule(p=st.sampled_from((0.0, 0.001, 0.5, 1.0)))
    def weigh_sense(self, p: float) -> None:
        self.is_misled = p > MAX_P_RIVAL
        self.is_certified = self.is_certified and not self.is_misled
        rivals = Rival("lens", "another lens", 1.0, p), Rival("chance", "chance", 0.0, 1.0 - p)
        self.agree(Difference("camera", rivals, (), 0.0))

    def agree(self, value: Certificate | Discrepancy | Difference) -> None:
        told = [item for item in self.messages.take(value) if item.topic == "/diagnostics"]
        assert (self.messages.is_certified, bool(self.messages.lost)) == (self.is_certified, self.is_lost)
        pose = self.messages.pose(Pose2(0.0, 0.0, 0.0), np.eye(3) * 1e-4).message.pose
        assert (pose.covariance[0] < 1.0) == self.is_certified
        level = 2 if self.is_lost else 1 - self.is_certified
        assert [item.message.status[0].level for item in told] in ([], [level])


TestCertainty = CertaintyMachine.TestCase
TestCertainty.settings = settings(max_examples=60, stateful_step_count=10, deadline=None)
