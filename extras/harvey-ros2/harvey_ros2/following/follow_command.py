"""``harvey follow``: a recording of a robot that somebody else drove: where it was, certified, and when it was lost."""

from __future__ import annotations

import math
import os
import statistics
import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand
from harvey.errors import BadInput
from logs.run_directory import RUNS, check_vacant

POSES = (".csv", ".tum")
MOST_GAP_S = 2.0
"""Where the odometry pauses for longer, nobody knows how the robot moved meanwhile [s]."""

if TYPE_CHECKING:
    from harvey_ros2.following.followed_poses import FollowedPoses
    from harvey_ros2.following.onlooker import FirstGuess, Onlooker
    from harvey_ros2.recordings.bag_reader import Bag, BagItem
    from world_models.building.world import World
    from world_models.frames import Pose2
    from world_models.robot import RobotModel


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", help="a bag of ROS 2 (mcap, sqlite3) or ROS 1, its folder or a file;"
                        " a video, or a folder of pictures; a robot that goes on, as ros2:robot.toml")
    parser.add_argument("--world", metavar="FILE", required=True,
                        help="the building: a world file, or the name of one that comes with Harvey")
    parser.add_argument("--start", metavar="PLACE", help='where it was first, in feet, as "(hallway (4,4,0))";'
                        " without it begins lost")
    parser.add_argument("--heading", metavar="DEGREES", type=float, default=0.0, help="and where it looked there (0)")
    parser.add_argument("--sigma", metavar="METRES", type=float, default=0.2,
                        help="standard deviation of that place (0.2)")
    parser.add_argument("--calibration", metavar="FILE",
                        help="the camera's file; else CameraInfo and tf_static of the bag say it")
    parser.add_argument("--odom", metavar="TOPIC|FILE", default="",
                        help="of a bag the topic of the odometry, where there are several; of pictures its file: TUM's"
                        " lines, or a .csv with time_s,x_m,y_m,heading_rad")
    parser.add_argument("--picture", metavar="TOPIC", default="", help="the pictures, where there are several")
    parser.add_argument("--base", metavar="FRAME", default="base_link", help="the robot's frame (base_link)")
    parser.add_argument("--distro", metavar="NAME", default="jazzy",
                        help="of a bag that does not say its types: humble, jazzy, kilted (jazzy)")
    parser.add_argument("--reach", metavar="X", type=float, default=1.0,
                        help="what the tape says of what the wheels claim (1)")
    parser.add_argument("--rate", metavar="HZ", type=float, default=0.0,
                        help="pictures a second of a folder without a list rgb.txt, or of a video that does not say it"
                        " rightly")
    parser.add_argument("--poses", metavar="FILE", default="",
                        help="write where it was: .csv, of each checked picture with protection level, or lost;"
                        " .tum, what is certified, for evo; by the recording's times")
    parser.add_argument("--out", metavar="DIR", help="where the run is kept (runs/BAG-follow)")


def _run(args: Namespace) -> int:
    from harvey_ros2.following.followed_poses import FollowedPoses
    from harvey_ros2.following.onlooker import Onlooker, build_onlooker_head
    from harvey_ros2.messages.messages import message_types
    from harvey_ros2.messages.run_messages import RunMessages
    from harvey_ros2.recordings.bag_reader import Bag
    from harvey_ros2.recordings.film_reader import is_film
    from world_models.files.toml.mission import named_file
    from world_models.files.toml.source import WORLDS

    if args.bag.startswith("ros2:"):
        return _run_live(args)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong with a video is said by us
    path = Path(args.bag)
    if args.poses and Path(args.poses).suffix not in POSES:
        raise BadInput(f"--poses: expected a name that ends in {' or '.join(POSES)}, got {args.poses!r}")
    world = named_file(args.world, WORLDS, Path())
    if args.distro not in ("humble", "jazzy", "kilted"):
        raise BadInput(f"--distro: expected humble, jazzy or kilted, got {args.distro!r}")
    out = check_vacant(Path(args.out) if args.out else RUNS / f"{path.stem}-follow")
    if is_film(path):
        return _run_film(args, path, world, out)
    with Bag(path, odometry=args.odom, picture=args.picture, distro=args.distro) as bag:
        known, robot = build_robot(bag, world, args)
        guess, events = _guess(args, known), FollowedPoses()
        messages = RunMessages(message_types("jazzy"), known, robot.lens, robot.mount, counts=False)
        onlooker = Onlooker(build_onlooker_head(path.stem, world, robot, guess), out, events.hear, messages=messages)
        took_s = follow_bag(bag.items(), onlooker, bag.left_out)
        for line in bag.tell():
            print(line)
    return _end(onlooker, events, took_s, args, out)


def _end(onlooker: Onlooker, events: FollowedPoses, took_s: list[float], args: Namespace, out: Path) -> int:
    knows, said = onlooker.judge()
    why = f"the recording ends; {said}"
    onlooker.close(why)
    print(f"{why}: {onlooker.pictures} pictures checked, {onlooker.certified} certified, lost {events.lost} times\n"
          f"{_tell_protection(onlooker.protection_m)}{_tell_times(took_s)}\n\n"
          f"open it with    harvey view {out}\nhave it told    harvey story {out}\n"
          f"for others      harvey export {out} --mcap {out.name}.mcap")
    if args.poses:
        events.write(Path(args.poses))
        print(f"{args.poses}: where it was")
    return 0 if knows else 1


def _run_film(args: Namespace, path: Path, world: Path, out: Path) -> int:
    from harvey_ros2.following.followed_poses import FollowedPoses
    from harvey_ros2.following.onlooker import Onlooker, build_onlooker_head
    from harvey_ros2.messages.messages import message_types
    from harvey_ros2.messages.run_messages import RunMessages
    from harvey_ros2.recordings.film_reader import Film
    from harvey_ros2.recordings.odometry_file import read_odometry_file

    film, counted = Film(path, args.rate), read_odometry_file(Path(args.odom)) if args.odom else []
    known, robot = build_robot(None, world, args)
    film.check_size(robot.lens)
    guess, events = _guess(args, known), FollowedPoses()
    messages = RunMessages(message_types("jazzy"), known, robot.lens, robot.mount, counts=False)
    onlooker = Onlooker(build_onlooker_head(path.stem, world, robot, guess), out, events.hear, messages=messages,
                        counts=bool(counted))
    took_s = follow_bag(film.beside(counted), onlooker, film.left_out) if counted else (
        follow_film(film.items(), onlooker))
    for what, number in sorted(film.left_out.items()):
        print(f"left out: {number} {what}")
    return _end(onlooker, events, took_s, args, out)


def follow_film(items: Iterable[BagItem], onlooker: Onlooker) -> list[float]:
    """Show pictures without odometry to an onlooker; returns how long each took [s]."""
    took_s: list[float] = []
    for item in items:
        onlooker.heard_s = item.time_s
        if onlooker.wants(item.time_s):
            then = time.perf_counter()
            onlooker.look(item.jpeg, item.time_s)
            took_s.append(time.perf_counter() - then)
    return took_s


def _run_live(args: Namespace) -> int:
    from harvey_ros2.following.followed_poses import FollowedPoses
    from harvey_ros2.following.live_robot import follow_robot
    from world_models.files.toml.mission import named_file
    from world_models.files.toml.source import WORLDS

    world = named_file(args.world, WORLDS, Path())
    known, robot = build_robot(None, world, args)
    out = check_vacant(Path(args.out) if args.out else RUNS / "robot-follow")
    events = FollowedPoses()
    onlooker = follow_robot(args.bag.partition(":")[2], world, known, robot, _guess(args, known), out, events.hear)
    knows, said = onlooker.judge()
    end = "knowing where it is" if knows else f"not knowing where it is ({said})"
    print(f"it was left {end}: {onlooker.certified} pictures certified, lost {events.lost} times\n\n"
          f"open it with    harvey view {out}\nhave it told    harvey story {out}")
    return 0 if knows else 1


def follow_bag(
    items: Iterable[BagItem], onlooker: Onlooker, left_out: Counter[str] | None = None
) -> list[float]:
    """Show a recording to an onlooker; returns how long each picture took [s]. ``left_out``: what is not shown."""
    took_s: list[float] = []
    last: Pose2 | None = None
    began_s: float | None = None
    newest_s = -math.inf

    def note_times() -> Iterator[BagItem]:
        nonlocal newest_s
        for item in items:
            newest_s = max(newest_s, item.time_s)
            yield item

    for time_s, counted, jpeg in pair_with_odometry(note_times(), left_out):
        began_s = onlooker.messages.epoch_s = time_s if began_s is None else began_s
        if last is not None:
            onlooker.move(last.inverse() @ counted, time_s - began_s)
        last = onlooker.messages.odometry = counted
        if onlooker.wants(time_s - began_s):
            then = time.perf_counter()
            onlooker.look(jpeg, time_s - began_s)
            took_s.append(time.perf_counter() - then)
        else:
            onlooker.pass_by(time_s - began_s)
    onlooker.heard_s = newest_s - (newest_s if began_s is None else began_s)
    return took_s


def pair_with_odometry(
    items: Iterable[BagItem], left_out: Counter[str] | None = None
) -> Iterator[tuple[float, Pose2, bytes]]:
    """Each picture with its time and where the wheels counted to be then, between two readings of the odometry.

    Those that lie between none are left out, and counted by why.
    """
    from harvey_ros2.recordings.bag_reader import MOST_WAITING
    from world_models.frames import Pose2, wrap_angle

    waiting: list[BagItem] = []
    left_out = Counter() if left_out is None else left_out
    before: tuple[float, Pose2] | None = None
    for item in items:
        if item.odometry is None:
            waiting.append(item)
            if len(waiting) > MOST_WAITING:
                del waiting[0]
                left_out["pictures of later times than the odometry"] += 1
            continue
        after = item.time_s, item.odometry
        while waiting and waiting[0].time_s <= after[0]:
            picture = waiting.pop(0)
            if picture.time_s < (after if before is None else before)[0]:
                left_out["pictures from before the odometry begins" if before is None else
                         "pictures that were recorded too late to be put in order"] += 1
            elif before is None or after[0] <= before[0]:
                yield picture.time_s, after[1], picture.jpeg
            elif after[0] - before[0] > MOST_GAP_S:
                left_out[f"pictures while the odometry pauses for more than {MOST_GAP_S:g} s"] += 1
            else:
                part = (picture.time_s - before[0]) / (after[0] - before[0])
                (_, a), (_, b) = before, after
                turned = wrap_angle(b.heading_rad - a.heading_rad)
                yield picture.time_s, Pose2(a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m),
                                            wrap_angle(a.heading_rad + part * turned)), picture.jpeg
        before = after
    if waiting:
        left_out["pictures of later times than the odometry"] += len(waiting)


def build_robot(bag: Bag | None, world: Path, args: Namespace) -> tuple[World, RobotModel]:
    """The building, and the robot by the options and the bag, if there is one. Raises BadInput and WorldError."""
    from logs.run_head import load_known_world
    from world_models.actuator import ActuatorModel
    from world_models.camera import NOT_STATED
    from world_models.files.toml.camera_file import load_camera
    from world_models.robot import RobotModel

    try:
        known = load_known_world(world)
    except OSError as error:
        raise BadInput(f"--world {args.world}: expected a world file, got: {error.strerror}") from None
    deviation = NOT_STATED
    if args.calibration:
        camera, mount, deviation = load_camera(Path(args.calibration))
        if bag is not None:
            bag.check_size(camera)
    elif bag is None:
        raise BadInput(f"--calibration: expected a camera file with a [mount] for {args.bag}, got none")
    else:
        camera, mount = bag.find_camera(args.base)
    if mount is None and bag is None:
        raise BadInput(f"{args.calibration}: expected a [mount], got none")
    if mount is None:
        raise BadInput(f"{args.bag}: expected tf_static to lead from {args.base} to the camera, or --calibration with "
                       "a [mount]")
    try:
        actuator = ActuatorModel(reach=args.reach)
    except ValueError as error:
        raise BadInput(f"--reach: {error}") from None
    return known, RobotModel(known, camera, mount, actuator, deviation=deviation)


def _guess(args: Namespace, world: World) -> FirstGuess:
    from harvey_ros2.following.onlooker import FirstGuess
    from world_models.commands import parse_command

    if not (math.isfinite(args.heading) and 0.0 < args.sigma <= 5.0):
        raise BadInput(f"--heading and --sigma: expected degrees and 0 to 5 m, got {args.heading:g} and {args.sigma:g}")
    if args.start:
        try:
            origin, _ = parse_command(f"(ptrans {args.start} {args.start})", world)
        except ValueError as error:
            raise BadInput(f"--start: {error}") from None
        if world.locale_at(origin.in_world(world).position) is None:
            raise BadInput(f"--start: expected a place within a room, got {args.start}")
        return FirstGuess(args.start, math.radians(args.heading), args.sigma, max(0.05, args.sigma / 2.0))
    return FirstGuess(f"({world.rooms[0]} (1,1,0))", sigma_m=None)


def _tell_protection(levels_m: Sequence[float]) -> str:
    """How far off the certified places may be, as a line; "" where there are none."""
    if not levels_m:
        return ""
    from world_models.entries import ALERT_LIMIT_M
    from world_models.words import metres

    available = sum(level_m <= ALERT_LIMIT_M for level_m in levels_m)
    return (f"protection level {metres(statistics.median(levels_m))} in the median; within the alert limit of"
            f" {metres(ALERT_LIMIT_M)} in {available} of {len(levels_m)}\n")


def _tell_times(took_s: list[float]) -> str:
    if len(took_s) < 20:
        return f"{len(took_s)} pictures"
    cuts = statistics.quantiles(took_s, n=20)
    return f"a picture took {1e3 * statistics.median(took_s):.0f} ms, 95 of 100 at most {1e3 * cuts[-1]:.0f} ms"


COMMAND = CliCommand(
    "follow", "a recording of a robot that somebody else drove: where it was, certified, or lost",
    (
        ('harvey follow bag --world research_center --start "(hallway (4,4,0))"', "a bag of ROS 2, and where it began"),
        ("harvey follow pictures --odom odometry.tum --world house.toml --calibration camera.toml", "a folder"),
        ("harvey follow drive.mp4 --world house.toml --calibration camera.toml", "a video, without odometry"),
        ("harvey follow ros2:robot.toml --world house.toml --calibration camera.toml", "a robot that Nav2 drives"),
        ("harvey follow drive.mcap --world house.toml --calibration camera.toml", "it begins lost, and finds itself"),
    ),
    _arguments, _run,
    "Odometry and pictures of the bag come to the same board as in a mission; what drives is left out. A pose is\n"
    "certain only where a certificate vouches for it. A robot that goes on gets the transform from map to odometry as\n"
    "long as that is so; rviz's 2D Pose Estimate begins again; Ctrl-C ends it. The run is kept, with its journal:\n"
    "harvey replay, why and story work as for a mission. A video has no odometry: from one picture to the next the\n"
    "robot may have gone anywhere at about half a metre a second; once lost it is seldom found. Exit code 0: in the\n"
    "end it knows where the robot is, by pictures; 1: it does not, or is lost; 2: bad input.",
)
