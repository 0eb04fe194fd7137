"""From clauses to acts: what a text asks to do and to see, one after the other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from harvey_words.reading.lexicon import Word
from harvey_words.reading.told_acts import COMPASS, POINTS, Act, ThingWords, describe
from harvey_words.reading.word_clauses import Clause, Part

RELATIONS = ("past", "before", "across", "between", "next-to")
MOST_PASSED = 6
"""Things that are passed in one act."""
Wheres = list[tuple[str, ThingWords]]
"""Prepositions with their things."""
LENGTHS_M = {"metre": 1.0, "foot": 0.3048}
SAME = ("same", "other")
"""Sides by that of what was named before."""
SIDES = (*SAME, "left", "right", "ahead", "behind", "north", "south", "east", "west")


@dataclass
class _Reader:
    """Turns clauses into acts, one clause after the other."""

    acts: list[Act] = field(default_factory=list)
    last_thing: ThingWords | None = None
    last_stretch: ThingWords | None = None
    wants_orient: bool = False
    side: str = ""
    goals: list[Act] = field(default_factory=list)
    notes_on: bool = False
    listed: str = ""

    def read(self, clause: Clause) -> None:
        """Add the acts of one clause."""
        parts = clause.parts
        verbs = {part.meaning for part in parts if part.sort == "verb"}
        verbs |= {"be"} if verbs & {"with", "meet", "there", "stand"} else set()
        things, ways, wheres = self._collect(parts, verbs)
        if self.listed and things and all(part.sort == "thing" for part in parts):
            things, wheres = [], [(self.listed, thing) for thing in things]  # "after the library and the mail room"
        is_list = clause.end == "and" and len(parts) == 1 and parts[0].meaning in RELATIONS
        self.listed = parts[0].meaning if is_list else ""
        begun, before = len(self.acts), self.acts[-1] if self.acts else None
        if self.wants_orient and (things or wheres) and not verbs & {"turn", "take", "go"}:
            self._orient(things, ways, wheres)
        elif verbs in ({"see"}, {"be"}) and things and not (self.acts or wheres or ways) and all(
                one.is_door and (one.names or "be" in verbs) for one in things):
            self.goals.append(Act("find", what=_merge(things)))  # "find Allen's office", and then how
        elif "goal" in verbs and (things or wheres) and not self._has_way():
            self.goals += [Act("see", what=one) for one in (*things, *(one for _, one in wheres)) if one.names]
        elif "exit" in verbs or (not verbs and not self._has_way() and [
                (meaning, one.is_door) for meaning, one in wheres] == [("from", True)]):  # "from your door, go left"
            self._exit(things, ways, wheres)
        elif things and self._is_walk_told([], []) and (
                (self.notes_on and not verbs) or verbs in ({"note"}, {"pass"})):
            self._note_before(things)  # "to the chair, over the crossing with the lamp"
        elif ("note" in verbs or (self.notes_on and not verbs)) and things:
            self.acts += [Act("note", what=thing) for thing in things]
        elif self._is_posture(parts, verbs):
            self._posture(things, wheres)
        elif verbs == {"face"} and not things and any(meaning in RELATIONS for meaning, _ in wheres):
            self._state(things, ways, wheres, verbs)  # "look on the left, just past the machine room"
        elif "face" in verbs or (verbs & {"turn"} and not ways and wheres and wheres[0][0] in ("to", "away")):
            self._face(things, ways, wheres)
        elif "take" in verbs and set(ways) <= {"ahead"} and any("unit" in thing.heads for thing in things):
            self._go(things, ways, wheres)  # "take one step forward"
        elif "go" in verbs and set(ways) & {"left", "right"} and not verbs & {"be"}:
            self._turn(things, ways, wheres)  # "go left at the chair"
        elif verbs & {"turn", "take"} and (ways or any(thing.is_stretch for thing in things)):
            self._turn(things, ways, wheres)
        elif "stand" in verbs:
            self.acts += [Act("see", what=thing) for thing in (*things, *(one for _, one in wheres))
                          if thing.heads or thing.names]
        elif "halt" in verbs and not (things or wheres):
            self.acts.append(Act("halt"))
        elif "halt" in verbs:
            self._go(things, ways, [("to" if one.heads & {"unit"} or meaning == "at" else meaning, one)
                                    for meaning, one in wheres], until=True)
        elif verbs == {"be"} and not things and [by for by, one in wheres[:1] if one.heads & POINTS] == ["to"]:
            self._go([], ways, wheres)  # "and to the very end, where the lamp is"
        elif verbs >= {"reach", "pass"}:
            self._go(things, ways, wheres, passing=True)  # "walk until you have passed the lamp"
        elif "reach" in verbs and "be" not in verbs:
            self._go(things, ways, wheres, until=True)
        elif verbs & {"go", "pass"} and not (verbs & {"be"} and any(thing.is_door for thing in things)):
            self._go(things, ways, wheres, passing="pass" in verbs and "go" not in verbs)
        elif "through" in verbs and any(thing.heads & {"crossing", "corner"} for thing in things):
            self._go(things, ways, wheres, passing=True)
        elif verbs & {"enter", "take", "through"}:
            self._enter(things, ways, wheres)
            if "through" in verbs and self.acts[-1:] and self.acts[-1].sort == "turn" and self.acts[-1].along:
                along = self.acts[-1].along  # through a hall is to its end
                self.acts.append(Act("go", until=replace(along, heads=along.heads | {"end", "hall"})))
        elif (verbs & {"be", "see"} and (things or wheres or not ways)) or ("goal" in verbs and not things and wheres):
            self._state(things, ways, wheres, verbs)
        else:
            self._terse(things, ways, wheres)
        begun = len(self.acts) if begun and self.acts[-1] is before else begun
        self.notes_on = clause.end == "and" and bool(self.acts) and (self.notes_on or self.acts[-1].sort == "note")
        self.wants_orient = clause.end == "so"
        text = " ".join(word.text for part in parts for word in part.words) or " ".join(verbs)
        self.acts[begun:] = [replace(act, text=text) for act in self.acts[begun:]]

    def _collect(self, parts: Sequence[Part], verbs: set[str]) -> tuple[list[ThingWords], list[str], Wheres]:
        """Things, ways, and prepositions with their things; sides belong to the thing before them."""
        things: list[ThingWords] = []
        ways: list[str] = []
        wheres: Wheres = []
        target: list[ThingWords] | None = None
        located = False
        turning = bool(verbs & {"turn", "take"}) and not verbs & {"be"}
        for part in parts:
            side = part.side or (part.meaning if part.sort == "way" else "") or self._read_side(part)
            if part.sort == "thing" and not (side and wheres):
                things.append(describe(part.words))
                target = things
            elif part.sort == "where" and not side:
                if part.meaning in RELATIONS and target is things and things and (verbs & {"be", "see"}) and things[
                        -1].is_door:
                    things[-1] = replace(things[-1], relations=(
                        *things[-1].relations, *self._relation(part.meaning, part.words)))
                elif not verbs and not things and part.meaning in ("on", "in") and all(
                        word.meaning == "it" for word in part.words) and part.words:
                    continue  # "his name's on it"
                elif part.words or part.meaning not in ("at", "on", "along" if self._it().is_door else "at"):
                    wheres.append((part.meaning, self._describe(part.meaning, part.words)))
                    target, located = None, True
                    continue
            elif part.sort == "where" and located and side in SIDES:
                meaning, one = wheres[-1]
                wheres[-1] = meaning, replace(one, side=side)  # "to the first hall on the right"
            elif side in SIDES and target and (part.sort == "where" or (target[-1].is_door and not turning)
                                               or "be" in verbs):
                target[-1] = replace(target[-1], side=side)
            elif part.sort == "where" and side:
                wheres.append(("on", ThingWords(side=side)))
            elif part.sort == "way":
                ways.append(side)
            located = False
        return [self._resolve(thing, verbs) for thing in things], ways, [
            (meaning if meaning != "by" else "along" if one.is_stretch else "past", self._resolve(one, {meaning}))
            for meaning, one in wheres]

    def _read_side(self, part: Part) -> str:
        """``The same side``, ``the other side``: left or right where that was said before."""
        meanings = {word.meaning for word in part.words}
        if not ("side" in meanings and meanings <= {"side", *SAME}) or len(meanings) != 2:
            return ""
        return "same" if "same" in meanings else "other"

    def _it(self) -> ThingWords:
        return self.last_thing or ThingWords()

    def _resolve(self, thing: ThingWords, by: set[str]) -> ThingWords:
        """What a pronoun stands for: the hall before, where one goes along it; and what the next one will stand for."""
        stretch = self.last_stretch or ThingWords()
        if "ending" in thing.heads:  # "until it ends", "where the gravel ends"
            thing = replace(thing, heads=frozenset(("end", "hall")), names=thing.names or stretch.names)
        elif "it" in thing.heads and len(thing.heads) > 1:  # "the end of it"
            thing = replace(thing, heads=(thing.heads - {"it"}) | stretch.heads, names=thing.names + stretch.names)
        elif "it" in thing.heads:
            hall = self.last_stretch or ThingWords(frozenset(("hall",)))
            thing = replace(hall if by & {"along", "go", "take"} else self._it(), side=thing.side, count=thing.count)
        if thing.names or thing.heads - {"side", "unit", "end"}:
            self.last_thing = thing
            self.last_stretch = thing if thing.is_stretch and not by & {"past", "across"} else self.last_stretch
        return thing

    def _relation(self, meaning: str, words: Sequence[Word]) -> Iterable[tuple[str, ThingWords]]:
        """A relation to a description; ``between`` is one to each of two."""
        cut = [index for index, word in enumerate(words) if word.meaning == "&"]
        if meaning == "between" and cut:
            return ((meaning, describe(words[:cut[0]])), (meaning, describe(words[cut[0] + 1:])))
        return ((meaning, self._describe(meaning, words)),) if words else ()

    def _describe(self, meaning: str, words: Sequence[Word]) -> ThingWords:
        """What follows a preposition: ``past it`` is past what was named in a clause before."""
        is_it = meaning in RELATIONS and all(word.meaning == "it" for word in words)
        return describe(words) if words and not is_it else self._it()

    # -- the sorts of clauses ----------------------------------------------------------------------------------------

    def _exit(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        by = [one for meaning, one in wheres
              if one.is_door and "door" in one.heads and meaning in ("past", "along", "to")]
        own = [thing for thing in things if thing.is_door and not ({"door"} & thing.heads and not thing.names)]
        if not any(act.sort == "exit" for act in self.acts[-1:]):
            self.acts.append(Act("exit", what=own[0] if own else None, along=by[0] if by else None))
        self.acts += [Act("turn", way) for way in ways if way not in ("ahead", "behind")]
        rest = [(meaning, one) for meaning, one in wheres
                if one not in by and meaning not in ("on", "at", "in", "away", "from")
                and not (meaning in ("to", "across") and one.is_stretch)]
        if rest:
            self._go([], [], rest)

    def _is_posture(self, parts: Sequence[Part], verbs: set[str]) -> bool:
        """``(with) your back to the wall``."""
        back = [index for index, part in enumerate(parts) if part.meaning in ("back", "behind")]
        turns = verbs & {"take", "go"} or ("turn" in verbs and parts[back[0]].meaning == "back") if back else True
        return not turns and any(
            part.words and part.sort in ("where", "thing") for part in parts[back[0]:])

    def _posture(self, things: list[ThingWords], wheres: Wheres) -> None:
        towards = [one for meaning, one in wheres if meaning in ("to", "away", "at", "on", "next-to")]
        if towards or things:
            self.acts.append(Act("orient", what=replace((towards or things)[0], side="behind")))

    def _orient(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        all_things = [*things, *(one for _, one in wheres)]
        side = next((one.side for one in all_things if one.side), ways[0] if ways else "ahead")
        side = "behind" if side == "back" else side
        what = next((one for one in all_things if one.names or one.heads), None)
        if what is not None:
            self.acts.append(Act("orient", what=replace(what, side=what.side or side)))

    def _face(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        turns = [way for way in ways if way in ("left", "right", *COMPASS)]
        self.acts += [Act("turn", way) for way in turns]
        if not turns:
            self._orient(things, ["behind" if any(meaning == "away" for meaning, _ in wheres) else "ahead"], wheres)

    def _turn(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        halls = [thing for thing in things if thing.is_stretch]
        counted = next((thing.place for thing in things if "unit" in thing.heads), math.inf)
        onto = [one for meaning, one in wheres if meaning in ("to", "along", "on", "in") and one.is_stretch
                and not (meaning == "to" and one.place > counted)]  # "right one block to the blue hall" walks there
        at = [one for meaning, one in wheres if (meaning == "at" or (meaning == "on" and not one.is_stretch))
              and (one.heads or one.names)]
        begin = [meaning for meaning, one in wheres if meaning in ("past", "before") or one in onto][:1]
        past = tuple(one for meaning, one in wheres if meaning in ("past", "before") and begin[0] == meaning)
        way = next((way for way in ways if way not in ("ahead", "behind")), "")
        hall = next(iter((*halls, *onto)), None)
        is_on = ("on", hall) in wheres  # "left on the brick two", not "the second left onto the brick"
        blocks = [thing for thing in things if "unit" in thing.heads or (is_on and thing.count and not thing.heads)]
        number = next((thing.number for thing in things if thing.number and not blocks), 0)
        if way == "" and hall is not None and hall.side != "ahead":
            way = hall.side
        self.acts.append(Act("turn", way, along=hall, until=at[0] if at and way else None, past=past if way else (),
                             units=number if not halls else 0))
        rest = [(meaning, one) for meaning, one in wheres
                if one is not hall and not (way and (one in at or one in past))
                and meaning in ("to", "past", "along", "at") and one.text]
        self.last_stretch = hall
        if rest or blocks:
            self._go(blocks, [], rest)

    def _go(self, things: list[ThingWords], ways: list[str], wheres: Wheres, *,
            until: bool = False, passing: bool = False) -> None:
        self._turn_only(ways)
        units, metres = 0, 0.0
        ends: list[ThingWords] = []
        passed: list[ThingWords] = []
        along: ThingWords | None = None
        for meaning, one in [*(("", thing) for thing in things), *wheres]:
            counts = "crossing" in one.heads and one.number and meaning == "" and any(by == "to" for by, _ in wheres)
            is_number = one.number and not one.heads and not one.names and not one.side
            if is_number and meaning == "to" and passed:
                ends.append(replace(passed.pop(), count=one.count))  # "past the first crossing to the second one"
            elif one.heads & {"unit"} or counts or is_number:
                units = one.number or 1
                if not counts and (one.names or one.heads - {"unit"}):
                    along = along or replace(one, heads=frozenset(("hall",)), count="")
            elif one.heads & set(LENGTHS_M):
                metres = one.number * LENGTHS_M[next(iter(one.heads & set(LENGTHS_M)))]
            elif meaning in ("past", "across") or (meaning == "" and passing):
                passed.append(one)
            elif not one.heads & POINTS and not (meaning == "" and one.number) and (
                    (meaning in ("along", "on", "in") and (one.is_stretch or not one.is_door))
                    or (meaning == "" and one.is_stretch and not until)):
                along = along or one
            elif meaning == "from":
                self.acts.append(Act("see", what=one))
            elif meaning == "away":
                self.acts += [] if one.is_door else [Act("orient", what=replace(one, side="behind"))]
            elif one.heads or one.names or one.count:
                ends.append(one)
        if not (ends or passed or along or units or metres or things or ways or wheres) and self.acts and self.acts[
                -1].sort in ("orient", "see"):
            ends = [replace(self._it(), side="")]  # "go there"
        end, past = ends[0] if ends else None, tuple(passed[:MOST_PASSED])
        if end is not None and end.is_door and not end.heads & {"end", "crossing", "corner", "hall"}:
            if along or passed or units:
                self.acts.append(Act("go", past=past, along=along, units=units, metres=metres))
            self.acts.append(Act("find", what=_at_end(replace(end, count=end.count), wheres)))
        else:
            self.acts.append(Act("go", until=end, past=past, along=along, units=units, metres=metres))
        onward = [one for meaning, one in wheres if meaning == "to"]
        at_end = end is not None and (end.is_door or "wall" in end.heads)
        for more in [one for one in ends[1:] if "end" not in one.heads or not (at_end or (end and "end" in end.heads))]:
            self.acts.append(Act("find", what=more) if more.is_door else
                             Act("go", until=more) if more in onward else Act("see", what=more))

    def _turn_only(self, ways: Sequence[str]) -> None:
        self.acts += [Act("turn", way) for way in ways if way in ("left", "right", "back", *COMPASS)]
        self.last_stretch = None if ways else self.last_stretch

    def _enter(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        what = [thing for thing in things if not thing.is_stretch]
        what += [one for meaning, one in wheres if meaning in ("to", "at", "in", "on") and one.is_door]
        halls = [one for one in (*things, *(one for _, one in wheres)) if one.is_stretch]
        if halls and not (what and what[0].is_door):
            self._turn(halls, ways, [(meaning, one) for meaning, one in wheres if one is not halls[0]])
        elif not what:
            self._terse(things, ways, wheres)
        else:
            side = next((way for way in ways if way in SIDES), "")
            goal = replace(what[0], side=what[0].side or side, relations=(
                *what[0].relations, *((meaning, one) for meaning, one in wheres if meaning in RELATIONS)))
            self.acts.append(Act("find", what=_at_end(goal, wheres), enters=True))

    def _state(self, things: list[ThingWords], ways: list[str], wheres: Wheres, verbs: set[str]) -> None:
        """A sentence that says what is where."""
        if len(things) > 1 and things[-1].count and not things[-1].heads and not things[-1].names:
            *things, rank = things  # "the pink carpet is the first on your left", "the easel is one ahead"
            if rank.side == "ahead" and rank.number:
                self.acts.append(Act("go", units=rank.number))
            else:
                things[-1] = replace(things[-1], count=rank.count, side=rank.side)
        if "there" in verbs and things and things[0].number > 1 and "unit" not in things[0].heads:
            self.acts.append(Act("see", what=replace(things[0], count="")))  # "there are two closets"
            return
        related = tuple((meaning, one) for meaning, one in wheres if meaning in RELATIONS)
        side = next((one.side for _, one in wheres if one.side), ways[0] if ways else "")
        blocks = [thing for thing in things if "unit" in thing.heads]
        if blocks and len(things) > 1:  # "an easel one block in front of you"
            side = side or blocks[0].side
            things = [thing for thing in things if "unit" not in thing.heads]
        doors = [thing for thing in things if thing.is_door or (
            thing.count and thing.side and not thing.heads and not thing.names)]
        doors += [one for meaning, one in wheres if meaning in ("in", "at") and one.is_door]
        if doors:
            goal = _merge(doors)
            goal = replace(goal, side=goal.side or (side if side in SIDES else ""),
                           relations=(*goal.relations, *related))
            goal = _at_end(goal, wheres)
            self.acts.append(Act("find", what=goal))
        elif not things and (related or side):
            self.acts.append(Act("find", what=ThingWords(frozenset(("door",)), side=side, relations=related)))
        ended = next((one for meaning, one in wheres if meaning in ("at", "in") and "end" in one.heads), None)
        if ended is not None and not doors:
            self.acts.append(Act("go", until=ended) if self._has_way() else Act("find", what=ended))
        for thing in (*things, *(one for meaning, one in wheres if meaning == "at")):
            if thing.number and thing.heads & POINTS:
                self.acts.append(Act("go", until=thing))  # "it is the next crossing", "the chair is at the next one"
        for thing in things:
            if "unit" in thing.heads:
                self.acts.append(Act("go", units=thing.number or 1))
            elif "end" in thing.heads and thing not in doors:
                self.acts.append(Act("go", until=thing))
            elif thing not in doors and not (thing.number and thing.heads & POINTS):
                self.acts.append(Act("see", what=replace(thing, side=thing.side or (side if side in SIDES else ""))))
        places = [one for meaning, one in wheres if meaning in ("at", "in", "on", "to") and (one.heads or one.names)]
        self.acts += [Act("see", what=one) for one in places
                      if not (doors and (one.is_stretch or one in doors)) and "end" not in one.heads
                      and not (one.number and one.heads & POINTS)]

    def _terse(self, things: list[ThingWords], ways: list[str], wheres: Wheres) -> None:
        """No verb: ``second door on the right``, ``left``, ``past the machine room``."""
        related = tuple((meaning, one) for meaning, one in wheres if meaning in RELATIONS and one.text)
        side = next((one.side for _, one in wheres if one.side), "")
        last = self.acts[-1] if self.acts else None
        if last is None and things and wheres and not ways and all(
                meaning in ("at", "in") and one.heads & POINTS for meaning, one in wheres):  # "the lamp at the corner"
            self.acts.append(Act("find", what=_merge([wheres[0][1], *(one for one in things if not one.heads)])))
        elif not things and last is not None and last.sort in ("find", "see") and (related or side) and not ways:
            self._amend(related, side)
        elif things and things[0].heads == {"side"}:
            self.side = things[0].count if things[0].count in SAME else ""  # "same side as this room, the next door"
        elif side and not things and not related and not ways:
            self.side = side  # "on your right, the last door"
        elif wheres and self._is_walk_told(things, ways) and all(meaning == "past" for meaning, _ in wheres):
            self._note_before([one for _, one in wheres])
        elif things and things[0].is_stretch and things[0].side in ("left", "right") and last and not things[0].count:
            self._turn(things, [*ways, things[0].side], wheres)  # "then the flowers on the left"
        elif things and "unit" in things[0].heads and last and last.sort == "find" and (things[0].side or side or ways):
            self._amend((), things[0].side or side or ways[0])  # "it is opposite, a few steps to the left"
        elif things and "unit" in things[0].heads and things[0].side in ("left", "right"):
            self._turn(things, [things[0].side], wheres)  # "one block to your right"
        elif (things and ways and "unit" in things[0].heads) or (set(ways) & {"left", "right"} and any(
                meaning in ("at", "on") for meaning, _ in wheres)):
            self._turn(things, ways, wheres)  # "left at the lamp", "right on the brick two"
        elif things and ways and things[0].number and not things[0].heads and not things[0].names:
            act = Act("go") if ways[0] == "ahead" else Act("turn", ways[0])  # "one forward", "second left"
            self.acts.append(replace(act, units=things[0].number))
        elif things and (things[0].is_door or (things[0].count and things[0].side and not things[0].is_stretch)):
            goal = _merge(things)
            side, self.side = goal.side or next(iter(ways), self.side), ""
            is_beyond = any(meaning == "past" for meaning, _ in related)
            is_named = last is not None and last.sort == "find" and bool(last.what and last.what.names) and not any(
                last.what.names == one.names for _, one in related if last.what)  # "the room across from it"
            if is_named and not goal.names and not is_beyond:
                self._amend(related, side)  # "the library is opposite, one door to the left"
            else:
                self.acts.append(Act("find", what=replace(goal, side=side, relations=related)))
        elif things and things[0].number and self.last_thing and self.last_thing.is_door and not (
                things[0].heads or things[0].names):
            self.acts.append(Act("find", what=replace(things[0], heads=frozenset(("door",)))))  # "the next one"
        elif things or any(one.heads or one.names or one.number for _, one in wheres):
            is_at = not things and not ways and all(meaning == "on" for meaning, _ in wheres)
            self._go(things, ways, [("at" if is_at else meaning, one) for meaning, one in wheres])
        else:
            self._turn_only(ways)
            if "ahead" in ways:
                self.acts.append(Act("go"))

    def _has_way(self) -> bool:
        """Whether anything was told to be done yet."""
        return any(act.sort in ("go", "turn", "exit") for act in self.acts)

    def _is_walk_told(self, things: Sequence[ThingWords], ways: Sequence[str]) -> bool:
        """Whether the act before is a walk with an end, and nothing is named to go to."""
        last = self.acts[-1] if self.acts else None
        return last is not None and last.sort == "go" and bool(last.units or last.until) and not things and not ways

    def _note_before(self, passed: Iterable[ThingWords]) -> None:
        """What is passed on the walk that was told last."""
        self.acts[-1:-1] = [Act("note", what=one, text=one.text) for one in passed]
        self.notes_on = True

    def _amend(self, related: Iterable[tuple[str, ThingWords]], side: str) -> None:
        """What is said afterwards of the thing before."""
        last = self.acts[-1]
        assert last.what is not None
        what = replace(last.what, side=last.what.side or side, relations=(*last.what.relations, *related))
        self.acts[-1] = replace(last, what=what)


def _merge(things: Sequence[ThingWords]) -> ThingWords:
    """``Allen's office is the next door on the left``: two descriptions of one thing."""
    first, *rest = things
    for other in rest:
        first = ThingWords(first.heads | other.heads, first.names + other.names, first.count or other.count,
                            first.side or other.side, (*first.relations, *other.relations),
                            f"{first.text} {other.text}")
    return first


def _at_end(goal: ThingWords, wheres: Sequence[tuple[str, ThingWords]]) -> ThingWords:
    """``The door at the end``: the one ahead, or the last on its side."""
    if not any("end" in one.heads for meaning, one in wheres if meaning in ("at", "in", "on")):
        return goal
    return replace(goal, count=goal.count or "last") if goal.side in ("left", "right") else replace(goal, side="ahead")


def read_acts(clauses: Sequence[Clause]) -> list[Act]:
    """The acts of a text in the order in which they are to be done."""
    clauses = _join_exits(_correct(list(_leave_warnings(clauses))))
    ordered: list[Clause] = []
    behind: Clause | None = None
    for clause in clauses:
        if clause.end == "when" and clause.parts:
            behind = clause
            continue
        is_out = behind is not None and [part.meaning for part in clause.parts] == ["exit"]
        ordered.insert(0 if is_out else len(ordered), clause)  # "the door across, to the left as you come out"
        if behind is not None and clause.parts:
            ordered.append(Clause(behind.parts, ""))
            behind = None
    reader = _Reader()
    for clause in ordered:
        reader.read(clause)
    if reader.acts and reader.acts[-1].sort == "find" == (reader.goals or reader.acts)[-1].sort and reader.goals:
        what, goal = reader.acts.pop().what, reader.goals.pop()  # "find Allen's office; it is the next door"
        reader.goals.append(replace(goal, what=what and goal.what and _merge((goal.what, what))))
    reader.acts += reader.goals
    if not any(act.sort in ("exit", "turn", "go") for act in reader.acts):  # "find the lamp, it is in the corner"
        reader.acts = [replace(act, sort="see") if act.sort == "orient" and act.what and act.what.side == "ahead"
                       else act for act in reader.acts]
        reader.acts.sort(key=lambda act: act.sort == "see")
        if all(act.sort == "see" for act in reader.acts[:1]):
            reader.acts[:1] = [replace(act, sort="find") for act in reader.acts[:1] if act.what and act.what.names]
    for index, act in enumerate(reader.acts[:-1]):
        after = reader.acts[index + 1]
        if act.sort == "find" == after.sort and act.what and after.what and any(
                by == "past" or one.names == act.what.names for by, one in after.what.relations):
            reader.acts[index] = replace(act, sort="see")  # "the library is on the left; it is the door after that"
    done = max((index for index, act in enumerate(reader.acts) if act.sort in ("go", "turn", "exit")), default=-1)
    ordered_acts = [replace(act, sort="see") if act.sort == "find" and index < done and not act.enters and reader.acts[
        index + 1].sort != "exit" else act for index, act in enumerate(reader.acts)]
    doors = [act for act in reader.acts if act.sort == "find" and act.what and act.what.is_door]
    if doors and not any(act.sort == "find" for act in ordered_acts):  # "the next door, left as you come out"
        ordered_acts = [*(act for act in reader.acts if act is not doors[-1]), doors[-1]]
    return ordered_acts


def _correct(clauses: Sequence[Clause]) -> list[Clause]:
    """``Turn right - no, left``: what is said after a correction stands for the clause before, or a part of it."""
    kept: list[Clause] = []
    is_fix = is_aside = False
    for clause in clauses:
        verbs = {part.meaning for part in clause.parts if part.sort == "verb"}
        counts = any(word.sort == "COUNT" for part in clause.parts for word in part.words)
        is_denial = [part.meaning for part in clause.parts[:1]] == ["not"] and clause.end != "but" and not verbs
        if (kept and is_denial) or (is_aside and verbs == {"be"} and not counts):
            is_aside = clause.end == "comma"
            continue  # "the second door, not the first, that is Allen's"
        is_aside = is_aside and not clause.parts
        wrong = next((place for place in range(len(kept) - 1, -1, -1) if kept[place].parts), None)
        if is_fix and clause.parts and wrong is not None:
            old, new = kept[wrong].parts, clause.parts
            if any(part.sort == "verb" for part in new):
                del kept[wrong:]
            else:
                same = [place for place, part in enumerate(old) if bool(part.words) == bool(new[0].words) and (
                    part.sort == new[0].sort or {part.sort, new[0].sort} == {"where", "thing"})]
                at = same[-1] if same else len(old)
                if same and all(word.sort == "COUNT" for word in new[0].words):  # "not the first door but the second"
                    named = tuple(word for word in old[at].words if word.sort != "COUNT")
                    new = [replace(old[at], words=new[0].words + named), *new[1:]]
                clause = Clause([*old[:at], *new, *old[at + 1:]], clause.end)
                del kept[wrong:]
        is_denied = clause.end == "but" and bool(clause.parts) and clause.parts[0].sort == "not"
        is_fix = clause.end == "fix" or is_denied or (is_fix and not clause.parts)
        clause = Clause(clause.parts[1:], clause.end) if is_denied else clause
        kept.append(clause)
    return kept


def _join_exits(clauses: Sequence[Clause]) -> list[Clause]:
    """``Left out of the lab`` and ``turn left coming out`` are one clause: one is out before one turns."""
    joined: list[Clause] = []
    for clause in clauses:
        before = joined[-1] if joined else Clause()
        ways = [part for part in before.parts if part.meaning in ("left", "right")]
        is_turn = ways and not before.end and all(part.sort in ("verb", "way") for part in before.parts)
        if is_turn and any(part.meaning == "exit" for part in clause.parts):
            joined[-1] = Clause([*ways, *clause.parts], clause.end)
        else:
            joined.append(clause)
    return joined


def _leave_warnings(clauses: Sequence[Clause]) -> Iterable[Clause]:
    """All sentences but those that say where one is when one has gone too far."""
    sentence: list[Clause] = []
    for clause in clauses:
        sentence.append(clause)
        if clause.end == "dot" or clause is clauses[-1]:
            if not any(part.meaning == "beyond" for one in sentence for part in one.parts):
                yield from (one for one in sentence if not any(part.meaning == "count" for part in one.parts))
            sentence = []
