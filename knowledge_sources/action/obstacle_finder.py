"""Obstacle finder (§4: models are incomplete): what stands on the floor, and is not in the model, is in the way.

It is told of by touch, by pictures of the floor or by range sensors; and it is forgotten when its floor is seen free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import shapely

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.floor_ahead import SEEN_MARGIN_M, find_known_free
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.see_floor import FLOOR_VIEW_DISTANCE_M
from knowledge_sources.methods.motion.footprints import (
    Corners,
    build_free_floor,
    build_polygon,
    deepen,
    join_footprints,
    list_corners,
    measure_change_m,
    measure_common_directions,
    measure_free_part,
    measure_hull_part,
    measure_width_m,
    take_free,
)
from knowledge_sources.methods.motion.routes import find_nearest
from knowledge_sources.questions import (
    current_leg,
    find_belief,
    find_building,
    find_frames,
    find_robot,
    is_in_doubt,
    last_motion,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from knowledge_sources.settings import ActionSettings
from world_models.building.building import Building
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.building.locales import EXTRA_KIND, Doorway
from world_models.entries.body import MotorCommand
from world_models.entries.floor import FloorThing, FreeFloor
from world_models.entries.location import Hypothesis, Place
from world_models.entries.obstacle import Contact, Obstacle, ObstacleStatus
from world_models.entries.task import Certificate, Leg

VAGUE_SIGMA_M = 0.05  # sights of an obstacle whose standard deviations differ by this and twofold are not joined
MIN_COMMON_DIRECTIONS = 0.6
"""A sight without feet tells nothing new where this part of its directions is that of what is known."""
TOUCH_MARGIN_M = 0.05  # a wall or thing of the model that is so much further than the robot's rim explains a contact
MAX_TOUCH_SIGMA_RAD = 0.6  # a contact whose direction is less sure tells of no obstacle
MIN_FREE_PART = 0.5  # part of an obstacle's footprint that must be seen free to tell that it is not there any more
MAX_SHARED_PART = 0.25  # where a thing that is seen takes more of the footprint, the rest seen free tells nothing of it
FREE_FLOOR_ODDS = 0.03  # odds of an obstacle that is there while all of its footprint is seen free
MIN_EVIDENCE_INTERVAL_S = 0.3  # pictures that follow each other faster are no further evidence of an obstacle
MAX_OBSTACLE_SIGMA_M = 0.25
"""What is seen on the floor with a larger standard deviation is waited for until it is nearer."""
MAX_HULL_PART = 1.5  # two sights are of one thing where the hull round both is at most so much larger than both
OBSTACLE_DEPTH_M = 0.3  # depth that something is taken to have of which only the near side is seen
MIN_HEIGHT_CHANGE_M = 0.15  # the same of its height
MAX_BEHIND_DOOR_M = 4.0  # a thing that is seen through a doorway stands at most so far behind it


@dataclass
class _Draft:
    """What an act concludes of one obstacle: its entry so far, if there is one, and what it is now."""

    old: Entry[Obstacle] | None
    new: Obstacle
    because: list[object] = field(default_factory=list)


class ObstacleFinder(OlderSource):
    """Concludes that something stands in the way, and puts it into the frame of its locale; or that it is gone.

    Of a contact it waits until a milestone was verified where the robot touched: as long as its place is in doubt, a
    contact may be with a wall. The model explains a contact where a wall or a thing is near enough to be touched, by
    what the belief leaves open. Then nothing is concluded; nor where the contact's direction is not known. How large
    the thing is a touch does not tell: it is taken to be ``obstacle_width_m`` wide and deep.

    What is seen on the floor is joined with what is known there already. It is there when it is certain enough, by one
    sure picture or two unsure ones, or by one where it is next on the way; and gone when most of its footprint is seen
    to be free floor. Where its feet were not seen, it may reach to the robot's rim. The frame is revised only when the
    footprint has changed so much that plans may change.
    """

    level = Level.ACTION
    on = (
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
        Watch(FreeFloor, (Posted,)),
        Watch(Leg, (Revised,), lambda leg: leg.status == "halted"),
    )
    writes = (Obstacle, LocaleFrame)

    def judge(self, view: View, trigger: Change) -> float | None:
        if isinstance(trigger.entry.value, FreeFloor):
            if find_belief(view) is None or is_in_doubt(view):
                return None
            return 0.95 if trigger.entry.value.things or view.latest(Obstacle, _may_be_there) else None
        if isinstance(trigger.entry.value, Leg):
            return 0.95 if any(True for _ in self._find_halting(view, trigger.entry)) else None
        if any(True for _ in self._take_back(view, trigger.entry)):
            return 0.95
        return None if self._find_sure_touch(view) is None else 0.95

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        if isinstance(trigger.entry.value, FreeFloor):
            drafts = list(self._weigh_floor(view, trigger.entry))
        elif isinstance(trigger.entry.value, Leg):
            drafts = list(self._find_halting(view, trigger.entry))
        else:
            touch = self._find_sure_touch(view)
            drafts = [] if touch is None else list(self._weigh_touch(view, touch, trigger.entry))
            touched = {draft.old.id for draft in drafts if draft.old is not None}
            drafts += [draft for draft in self._take_back(view, trigger.entry)
                       if draft.old is not None and draft.old.id not in touched]
        yield from self._write(view, drafts)

    def _find_sure_touch(self, view: View) -> _Touch | None:
        """The newest contact, where its direction is known well enough."""
        touch, most_rad = _find_new_touch(view), MAX_TOUCH_SIGMA_RAD
        return touch if touch is not None and touch.contact.value.sigma_rad <= most_rad else None

    def _take_back(self, view: View, belief: Entry[Hypothesis]) -> Iterator[_Draft]:
        """What was seen since a milestone was last verified, where the robot was lost since: its place rests on a
        belief that proved wrong. What is there is seen anew.
        """
        if belief.value.basis != "relocalization":
            return
        sure = view.latest(Certificate, lambda certificate: certificate.verdict == "verified")
        for entry in view.where(Obstacle, lambda o: _may_be_there(o) and o.touched_s is None):
            if sure is None or entry.cycle > sure.cycle:
                told = f"taken back: its place rested on a belief that {belief.ref} proved wrong"
                yield _Draft(entry, replace(entry.value, status="gone", certainty=0.0, evidence=told), [belief])

    # -- touch ---------------------------------------------------------------------------------------------------------

    def _weigh_touch(self, view: View, touch: _Touch, belief: Entry[Hypothesis]) -> Iterator[_Draft]:
        robot, locale, s = find_robot(view), belief.value.locale, self._settings.action
        contact = touch.contact
        pose, c = belief.value.world_from_robot(robot.world), contact.value
        sigma_m = math.hypot(belief.value.sigma_m, robot.radius_m * math.hypot(belief.value.sigma_rad, c.sigma_rad))
        ahead = pose.heading_rad - touch.turned_rad + c.direction_rad
        out, across = np.array([math.cos(ahead), math.sin(ahead)]), np.array([-math.sin(ahead), math.cos(ahead)])
        touched = np.array(pose.position) + robot.radius_m * out
        reach_m = TOUCH_MARGIN_M + 3.0 * belief.value.sigma_m
        known = _find_touched(view, touched, reach_m + 3.0 * sigma_m)
        if known is not None:
            yield _Draft(known, self._touch_again(robot.world, known.value, touched, out, across, c.when_s),
                         [*touch.because, belief])
            return
        if find_nearest(robot.world, locale, pose.position)[0] <= robot.radius_m + reach_m:
            return
        footprint = _build_footprint(touched, out, across, s.obstacle_width_m)
        at = Place.of_world(robot.world, locale, float(touched[0]), float(touched[1]))
        found = Obstacle(
            _name_next(view, locale), locale, footprint, sigma_m, at.x_m, at.y_m, s.obstacle_width_m,
            certainty=s.max_obstacle_certainty, seen_s=c.when_s, looked_s=c.when_s, touched_s=c.when_s, by="touch",
            evidence=c.sentence())
        yield _Draft(None, found, [*touch.because, belief])

    def _touch_again(
        self, world: Building, known: Obstacle, touched: Floats, out: Floats, across: Floats, when_s: float
    ) -> Obstacle:
        """A known obstacle after it was touched: it reaches to where it was touched."""
        s = self._settings.action
        corner = build_polygon(_build_footprint(touched, out, across, 0.5 * OBSTACLE_DEPTH_M))
        joined = shapely.convex_hull(shapely.union_all([build_polygon(known.footprint), corner]))
        core = list_corners(shapely.union(build_polygon(known.core), corner)) if known.core else ()
        new = replace(known, footprint=list_corners(joined), core=core, certainty=s.max_obstacle_certainty,
                      seen_s=when_s, looked_s=when_s, touched_s=when_s, status="there")
        return _place(world, new, joined)

    # -- floor ---------------------------------------------------------------------------------------------------------

    def _weigh_floor(self, view: View, scan: Entry[FreeFloor]) -> Iterator[_Draft]:
        """What a sight of the floor tells of each thing in it, and of each obstacle whose floor it shows."""
        f, s = scan.value, self._settings.action
        free = build_free_floor(f.x_m, f.y_m, f.bearings_rad, f.near_m, np.subtract(f.far_m, f.sigma_m).tolist())
        drafts: dict[str, _Draft] = {}
        known = {entry.id: entry for entry in view.all(Obstacle)}
        fresh = 0
        for thing in f.things:
            if thing.p_thing < s.min_thing_certainty or thing.sigma_m > MAX_OBSTACLE_SIGMA_M:
                continue
            shape = deepen(thing.footprint, (f.x_m, f.y_m), OBSTACLE_DEPTH_M)
            core = shape
            if thing.is_cut:
                shape = self._reach_to_rim(view, shape, f)
            rest, whole = [e for e in known.values() if e.id not in drafts], MAX_HULL_PART
            if f.sense == "ranges":  # an echo tells how far a thing is, not where in its cone: any in it may be heard
                rest, whole = [e for e in rest if _may_be_there(e.value)], math.inf
            entry = self._find_before(rest, core, (f.x_m, f.y_m)) if thing.is_cut else None
            entry = entry or _find_same(rest, shape, thing.sigma_m, whole)
            if entry is not None:
                new = self._see_again(view, entry, thing, shape, free, scan)
                if new is not None:
                    drafts[entry.id] = _Draft(entry, _with_core(new, _keep_touched(entry.value, core)), [scan])
                continue
            again = [build_polygon(draft.new.footprint) for draft in drafts.values()]
            if any(shapely.intersection(polygon, shape).area > 0.5 * shape.area for polygon in again):
                continue  # another part of what was joined already
            found = self._see_first(view, thing, shape, scan, fresh)
            if found is not None:
                fresh += 1
                drafts[f"new {fresh}"] = _Draft(None, _with_core(found, core), [scan])
        driving = current_leg(view)
        ahead = shapely.Polygon() if driving is None else self._find_way_ahead(view, driving[0].value)
        for draft in drafts.values():
            is_next = draft.new.status == "suspected" and build_polygon(draft.new.footprint).intersects(ahead)
            yield replace(draft, new=replace(draft.new, status="there")) if is_next else draft
        seen = shapely.union_all([build_polygon(thing.footprint).buffer(2.0 * thing.sigma_m) for thing in f.things])
        for entry in known.values():
            if entry.id in drafts or not _may_be_there(entry.value):
                continue
            if measure_free_part(entry.value.footprint, seen) <= MAX_SHARED_PART:
                gone = self._miss(find_building(view), entry.value, free, f.seen_s)
                if gone is not None:
                    yield _Draft(entry, gone, [scan, entry])

    def _find_halting(self, view: View, leg: Entry[Leg]) -> Iterator[_Draft]:
        """What is suspected right before a leg that was halted for it: it is held to be there."""
        ahead = self._find_way_ahead(view, leg.value)
        for entry in view.where(Obstacle, lambda o: o.status == "suspected"):
            if build_polygon(entry.value.footprint).intersects(ahead):
                yield _Draft(entry, replace(entry.value, status="there"), [entry, leg])

    def _find_before(
        self, known: Iterable[Entry[Obstacle]], seen: shapely.Geometry, eye: tuple[float, float]
    ) -> Entry[Obstacle] | None:
        """The obstacle that a sight without feet is one of: known well, nearer than the picture's border, and in most
        of its directions, where its top may be wider than its feet.
        """
        at, overhang_m = np.array(eye), self._settings.plan.overhang_m
        reach_m = float(np.linalg.norm(shapely.get_coordinates(seen) - at, axis=1).max())
        best: tuple[float, Entry[Obstacle]] | None = None
        for entry in known:
            wide = build_polygon(entry.value.footprint).buffer(overhang_m)
            if not entry.value.is_there or entry.value.sigma_m > VAGUE_SIGMA_M:
                continue
            if wide.distance(shapely.Point(at)) > reach_m:
                continue
            part = measure_common_directions(wide, seen, at)
            if part >= MIN_COMMON_DIRECTIONS and (best is None or part > best[0]):
                best = part, entry
        return None if best is None else best[1]

    def _find_way_ahead(self, view: View, leg: Leg) -> shapely.Geometry:
        """What the robot will sweep next on its leg."""
        belief, s = find_belief(view), self._settings.action
        if belief is None:
            return shapely.Polygon()
        robot = find_robot(view)
        here = shapely.Point(belief.value.world_from_robot(robot.world).position)
        way = shapely.LineString([here, (leg.x1_m, leg.y1_m)])
        around_m = robot.radius_m + SEEN_MARGIN_M
        return shapely.intersection(way, here.buffer(s.act_within_m)).buffer(around_m)

    def _reach_to_rim(self, view: View, shape: shapely.Polygon, scan: FreeFloor) -> shapely.Polygon:
        """What a thing whose feet are not seen may take: from the robot's rim on, but for floor that is known free."""
        belief, s = find_belief(view), self._settings.action
        if belief is None:
            return shape
        eye, rim_m = np.array([scan.x_m, scan.y_m]), find_robot(view).radius_m + SEEN_MARGIN_M
        away = shapely.get_coordinates(shape)[:-1] - eye
        rim = eye + rim_m * away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        whole = build_polygon(np.concatenate([shapely.get_coordinates(shape), rim]))
        unseen = shapely.difference(whole, find_known_free(view, belief, s))
        return build_polygon(shapely.get_coordinates(shapely.union(shape, _largest_part(unseen))))

    def _see_first(
        self, view: View, thing: FloorThing, shape: shapely.Polygon, scan: Entry[FreeFloor], before: int
    ) -> Obstacle | None:
        """A thing that was not known; None where walls and things of the model may be all that is seen."""
        world, f, s = find_building(view), scan.value, self._settings.action
        locale = _find_room(world, shape, f.locale, MAX_BEHIND_DOOR_M)
        margin_m = TOUCH_MARGIN_M + thing.sigma_m
        unexplained = shapely.intersection(shape, _find_open_floor(world, locale, margin_m))
        if unexplained.area < 0.3 * shape.area:
            return None
        own = shapely.intersection(shape, _find_open_floor(world, locale, 0.0))
        footprint = list_corners(own)
        if not footprint:
            return None
        found = Obstacle(
            _name_next(view, locale, before), locale, footprint, thing.sigma_m, 0.0, 0.0, 0.0, thing.height_m,
            thing.sigma_height_m, min(thing.p_thing, s.max_obstacle_certainty), f.seen_s, f.seen_s, None, f.sense,
            _tell(thing, scan), _status(thing.p_thing, s))
        return _place(world, found, own)

    def _see_again(
        self, view: View, entry: Entry[Obstacle], thing: FloorThing, shape: shapely.Polygon, free: shapely.Geometry,
        scan: Entry[FreeFloor],
    ) -> Obstacle | None:
        """A known obstacle after it was seen once more; None where that tells nothing that matters.

        What deceives the eye once does so again from the same place: only another sight is further evidence.
        """
        s, seen_s, known, world = self._settings.action, scan.value.seen_s, entry.value, find_building(view)
        certainty = max(known.certainty, thing.p_thing)
        if known.status == "gone":
            certainty = thing.p_thing
        elif _measure_way_m(view, entry, scan) >= FLOOR_VIEW_DISTANCE_M / 2.0:
            certainty = _combine(known.certainty, thing.p_thing / (1.0 - min(thing.p_thing, 0.999)))
        certainty = min(certainty, s.max_obstacle_certainty)
        own = shapely.intersection(shape, _find_open_floor(world, known.locale, 0.0))
        polygon = build_polygon(known.footprint)
        if scan.value.sense == "ranges" and known.status != "gone":  # nor how wide it is
            joined = take_free(polygon, free)
        else:
            joined = _weigh_footprints(polygon, shape if own.is_empty else own, free, known.sigma_m, thing.sigma_m,
                                       np.array([scan.value.x_m, scan.value.y_m]))
        footprint = list_corners(joined)
        moved = measure_change_m(known.footprint, footprint) >= s.min_footprint_change_m
        surer = certainty > known.certainty + 0.005 or _status(certainty, s) != known.status
        higher = thing.sigma_height_m < 0.7 * known.sigma_height_m
        if not (moved or surer or higher or seen_s - known.seen_s >= 2.0):
            return None
        height, sigma = (thing.height_m, thing.sigma_height_m) if higher else (known.height_m, known.sigma_height_m)
        status: ObstacleStatus = "there" if known.is_there else _status(certainty, s)
        new = replace(known, certainty=certainty, seen_s=seen_s, looked_s=seen_s, status=status, height_m=height,
                      sigma_height_m=sigma, sigma_m=min(known.sigma_m, thing.sigma_m), evidence=_tell(thing, scan))
        return _place(world, replace(new, footprint=footprint), joined) if moved and footprint else new

    def _miss(self, world: Building, known: Obstacle, free: shapely.Geometry, seen_s: float) -> Obstacle | None:
        """A known obstacle after its floor, or some of it, was seen free; None where that tells nothing."""
        s, polygon = self._settings.action, build_polygon(known.footprint)
        free_part = measure_free_part(known.footprint, free)
        if seen_s - known.looked_s < MIN_EVIDENCE_INTERVAL_S:
            return None
        if free_part >= MIN_FREE_PART:
            certainty = _combine(known.certainty, FREE_FLOOR_ODDS**free_part)
            status: ObstacleStatus = "gone" if certainty < s.min_gone_certainty else known.status
            return replace(known, certainty=certainty, looked_s=seen_s, status=status)
        left = take_free(polygon, free)
        footprint = list_corners(left)
        if not footprint or measure_change_m(known.footprint, footprint) < s.min_footprint_change_m:
            return None
        return _place(world, replace(known, footprint=footprint, looked_s=seen_s), left)

    # -- board ---------------------------------------------------------------------------------------------------------

    def _write(self, view: View, drafts: Iterable[_Draft]) -> Iterable[Effect]:
        """The obstacles, and the frames that have them."""
        changes: dict[str, list[tuple[Obstacle, Effect]]] = {}
        for draft in drafts:
            because = tuple(draft.because)
            effect: Effect = Post(draft.new, because) if draft.old is None else Revise(draft.old, draft.new, because)
            yield effect
            changes.setdefault(draft.new.locale, []).append((draft.new, effect))
        for frame in find_frames(view, changes):
            value, reasons = frame.value, list[object]()
            for obstacle, effect in changes[frame.value.name]:
                revised = self._revise_frame(value, obstacle)
                if revised is not value:
                    value = revised
                    reasons.append(effect)
            if value is not frame.value:
                yield Revise(frame, value, (*reasons, frame))

    def _revise_frame(self, frame: LocaleFrame, obstacle: Obstacle) -> LocaleFrame:
        """A frame with an obstacle as it is known now; the same where no plan could change by it."""
        s = self._settings.action
        known = next((c for c in frame.changes if (c.what, c.name) == ("extra", obstacle.name)), None)
        if not obstacle.is_there:
            return frame if known is None else frame.restored("extra", obstacle.name)
        height_m = obstacle.height_m + obstacle.sigma_height_m if obstacle.is_height_known else 0.0
        change = FrameChange("extra", obstacle.name, self.name, obstacle.footprint, round(height_m, 2))
        if known is None:
            return frame.changed(change)
        moved_m = measure_change_m(known.footprint, change.footprint)
        is_touched = obstacle.touched_s == obstacle.seen_s
        same_height = abs(known.height_m - change.height_m) < MIN_HEIGHT_CHANGE_M
        if not is_touched and moved_m < s.min_footprint_change_m and same_height:
            return frame
        return frame.restored("extra", obstacle.name).changed(change)


def _weigh_footprints(
    known: shapely.Geometry, seen: shapely.Geometry, free: shapely.Geometry, known_sigma_m: float, sigma_m: float,
    eye: Floats,
) -> shapely.Geometry:
    """The footprint by two sights: the sharper one decides.

    A sight of which the feet are not seen tells in which directions the thing is, and that it is nearer than the
    picture's lower border: it adds to what is known only in directions in which nothing was known.
    """
    if known_sigma_m >= 2.0 * sigma_m + VAGUE_SIGMA_M:
        return seen
    vague_m = VAGUE_SIGMA_M
    is_vague = sigma_m >= 2.0 * known_sigma_m + vague_m or min(sigma_m, known_sigma_m) >= 2.0 * vague_m
    if is_vague and measure_common_directions(known, seen, eye) >= MIN_COMMON_DIRECTIONS:
        return take_free(known, free)
    return join_footprints(known, seen, free)


def _with_core(obstacle: Obstacle, seen: shapely.Geometry) -> Obstacle:
    """An obstacle with what was seen of its footprint last, where that is clearly less than the footprint."""
    footprint = build_polygon(obstacle.footprint)
    core = shapely.intersection(footprint, seen)
    is_less = 0.0 < core.area < 0.9 * footprint.area
    return replace(obstacle, core=list_corners(core) if is_less else ())


def _keep_touched(known: Obstacle, seen: shapely.Geometry) -> shapely.Geometry:
    """What was seen of a known obstacle, with what it took when it was touched: no picture takes that back."""
    if known.touched_s is None:
        return seen
    return shapely.union(seen, build_polygon(known.core or known.footprint))


def _largest_part(shape: shapely.Geometry) -> shapely.Geometry:
    return max(shapely.get_parts(shape), key=lambda part: part.area, default=shapely.Polygon())


def _may_be_there(obstacle: Obstacle) -> bool:
    return obstacle.status != "gone"


def _status(certainty: float, settings: ActionSettings) -> ObstacleStatus:
    return "there" if certainty >= settings.min_obstacle_certainty else "suspected"


def _combine(certainty: float, odds: float) -> float:
    """The probability after further evidence."""
    product = certainty / max(1e-9, 1.0 - certainty) * odds
    return product / (1.0 + product)


class _Touch(NamedTuple):
    """A contact, and what the robot has turned since.

    Attributes:
        because: the contact and the turns.
    """

    contact: Entry[Contact]
    turned_rad: float
    because: tuple[Entry[Any], ...]


def _find_new_touch(view: View) -> _Touch | None:
    """The newest contact, if no obstacle rests on it yet and the robot stands where it touched: it has only turned."""
    contact, last = view.latest(Contact), last_motion(view)
    if contact is None or last is None or any(o.value.touched_s == contact.value.when_s for o in view.all(Obstacle)):
        return None
    turned_rad, because = 0.0, list[Entry[Any]]([contact])
    if last.id != contact.because[0].id:
        for command in view.newest_first(MotorCommand):
            if command.id == contact.because[0].id:
                break
            if command.value.move_m != 0.0:
                return None
            turned_rad += command.value.turn_rad
            because.append(command)
        else:
            return None
    return _Touch(contact, turned_rad, tuple(because))


def _find_touched(view: View, touched: Floats, reach_m: float) -> Entry[Obstacle] | None:
    """The known obstacle that may have been touched."""
    at = shapely.Point(touched)
    near = [(build_polygon(entry.value.footprint).distance(at), entry.id, entry)
            for entry in view.where(Obstacle, _may_be_there)]
    distance_m, _, entry = min(near, default=(math.inf, "", None))
    return entry if distance_m <= reach_m else None


def _find_same(
    known: Iterable[Entry[Obstacle]], shape: shapely.Polygon, sigma_m: float, most_hull: float
) -> Entry[Obstacle] | None:
    """The obstacle that a thing is another sight of: that of which it covers most, within the standard deviations.

    What lies beside an obstacle, so that a hull round both would take much floor that neither takes, is another thing.
    """
    best: tuple[float, Entry[Obstacle]] | None = None
    for entry in known:
        polygon = build_polygon(entry.value.footprint)
        reach_m = 2.0 * math.hypot(sigma_m, entry.value.sigma_m)
        shared = shapely.intersection(polygon.buffer(reach_m), shape).area
        if shared > 0.0 and (best is None or shared > best[0]) and measure_hull_part(polygon, shape) <= most_hull:
            best = shared, entry
    return None if best is None else best[1]


def _measure_way_m(view: View, obstacle: Entry[Obstacle], scan: Entry[FreeFloor]) -> float:
    """How far the eye is from where the sight was taken on which an obstacle rests; infinite where that is gone."""
    last = next((ref.id for ref in obstacle.because if ref.id.startswith(FreeFloor.__name__)), "")
    before = view.get(last)
    if before is None:
        return math.inf
    return math.hypot(scan.value.x_m - before.value.x_m, scan.value.y_m - before.value.y_m)


def _find_room(world: Building, shape: shapely.Polygon, near: str, reach_m: float) -> str:
    """The room in which most of a thing stands, of that where the robot is and those next to it."""
    if shapely.Polygon(world.outline(near)).contains(shape.centroid):
        return near
    doors = {doorway.other(near): doorway for doorway in world.doorways_of(near)}
    rooms = [near, *(room for room, door in doors.items() if _measure_behind_m(door, shape) <= reach_m)]
    areas = [shapely.intersection(shapely.Polygon(world.outline(room)), shape).area for room in rooms]
    return rooms[int(np.argmax(areas))]


def _measure_behind_m(door: Doorway, shape: shapely.Polygon) -> float:
    """How far a thing is from a doorway."""
    return float(shapely.MultiPoint(np.concatenate(door.thresholds_world)).distance(shape))


def _find_open_floor(world: Building, locale: str, margin_m: float) -> shapely.Geometry:
    """The floor of a room, with its open doorways, so far from its walls and from what the file has there."""
    openings = [shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull.buffer(0.01)
                for doorway in world.doorways_of(locale)]
    floor = shapely.union_all([shapely.Polygon(world.outline(locale)), *openings])
    things = [shapely.Polygon(thing.footprint_world) for thing in world.things_of(locale)
              if thing.is_obstacle and thing.kind != EXTRA_KIND]
    return shapely.difference(shapely.buffer(floor, -margin_m), shapely.buffer(shapely.union_all(things), margin_m))


def _place(world: Building, obstacle: Obstacle, shape: shapely.Geometry) -> Obstacle:
    """An obstacle with the place and the width that follow from its footprint."""
    middle = shape.centroid
    at = Place.of_world(world, obstacle.locale, float(middle.x), float(middle.y))
    return replace(obstacle, x_m=round(at.x_m, 3), y_m=round(at.y_m, 3),
                   width_m=round(measure_width_m(obstacle.footprint), 3))


def _tell(thing: FloorThing, scan: Entry[FreeFloor]) -> str:
    """Which pixels of which picture tell of a thing."""
    picture = next((ref.id for ref in scan.because if ref.id.startswith("CameraPicture-")), scan.id)
    if scan.value.sense != "camera":
        return f"{scan.id}: {thing.evidence}"
    left, top, right, bottom = thing.box_px
    return f"{picture}, pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f}): {thing.evidence}"


def _name_next(view: View, locale: str, before: int = 0) -> str:
    return f"{locale}/obstacle-{1 + len(view.all(Obstacle)) + before}"


def _build_footprint(touched: Floats, out: Floats, across: Floats, side_m: float) -> Corners:
    """The corners of a square behind the point that was touched, its near side across the direction [m, world]."""
    half = 0.5 * side_m
    corners = (touched - half * across, touched + half * across, touched + half * across + side_m * out,
               touched - half * across + side_m * out)
    return tuple((float(x), float(y)) for x, y in corners[::-1])
