"""The people of a scene as a sentence needs them: where they are, what they look like, what they ask, where they walk.

As the referees of the league do, people are asked to stand where a command needs them: who is described is there, who
is to be followed sets out after `SETS_OUT_S`, or `FOUND_S` if the robot must look for them, and who is guided follows
the robot. The seed chooses the rest.
"""

import math

from errand_home.facts import facts_of
from errand_home.persons import appearance_of
from errand_home.topics import about_people
from errand_people.looks import Appearance
from executive.words.command import START
from executive.words.knowledge import ANYBODY
from executive.words.mission import Route
from executive.words.outlines import distance_m, inside
from plant.worlds.world import Spot

SETS_OUT_S, FOUND_S, WALKS_M_S, MOST_COUNTED = 90.0, 160.0, 0.8, 2
STOPS = "Thank you, please stop."


class Cast:
    """Rules of the people of a world, changed for the commands of a sentence."""

    def __init__(self, world, knowledge, rng):
        self.rules = {one.name: one for one in world.seed_rules.people}
        self.knowledge, self.rng = knowledge, rng
        self.spots = [spot for one in world.seed_rules.people for spot in one.poses]
        self.taken, self.placed, self.last = list[Spot](), set[str](), None

    def play(self, commands):
        """Changes the people for all commands; returns their rules."""
        self.named = {each for one in commands for each in (one.goal, str(one.object)) if each in self.knowledge.people}
        for command in commands:
            word = "" if command.task is None else command.task.word
            if command.goal in self.knowledge.people:
                at = command.goal_at or self.knowledge.people[command.goal].at
                self.last = self.put(command.goal, at)
            if word in ("seek", "deliver"):
                self.last = self.anybody(command.goal, appearance_of(str(command.object.plain)))
            elif word == "report":
                self.reported(command)
            elif word == "answer" and self.last is not None:
                quiz = facts_of(self.knowledge).quiz
                question = quiz[int(self.rng.integers(len(quiz)))].question
                self.change(self.last, answers={**self.rules[self.last].answers, "question": f"{question}?"})
            elif word in ("follow", "guide"):
                self.walks(word, command.goal, self.last if str(command.object) == ANYBODY else str(command.object))
        return tuple(self.free(rule) for rule in self.rules.values())

    def reported(self, command):
        """Puts the people of a question at its place, and the listener at the goal."""
        asked = about_people(str(command.object.plain))
        if asked is not None and asked.info:
            gesture = str(self.rng.choice(["none", "waving", "raising_left_arm", "pointing_right"]))
            self.anybody(asked.place, Appearance(gesture=gesture))
        for _ in range(0 if asked is None or asked.info else int(self.rng.integers(MOST_COUNTED + 1))):
            self.anybody(asked.place, asked.appearance)
        if command.goal not in (None, START) and command.goal not in self.knowledge.people:
            self.anybody(command.goal, Appearance())

    def anybody(self, place, wanted):
        """Puts somebody who is not named, nor the speaker, at a place; returns the name."""
        speakers = [name for name, rule in self.rules.items() if rule.ranges is not None]
        free = [name for name in self.rules if name not in {*self.placed, *self.named, *speakers}]
        return self.put(str(self.rng.choice(free)), place, wanted) if free else self.last

    def put(self, name, place, wanted=None):
        """Puts a person at a free spot of the room, nearest to a surface, with the traits that are wanted."""
        wanted, outline = wanted or Appearance(), self.knowledge.rooms[self.knowledge.room(place)]
        free = [one for one in self.spots if inside(outline, (one.x, one.y)) and one not in self.taken]
        right = [one for one in free if one.posture == (wanted.pose or "standing")]
        spots = right or [one for one in free if one.posture == "standing"] or free
        if not spots:
            return name
        surface = self.knowledge.surfaces.get(place)
        spot = spots[int(self.rng.integers(len(spots)))]
        if surface is not None:
            spot = min(spots, key=lambda one: distance_m(surface.polygon, (one.x, one.y)))
        self.taken.append(spot)
        if wanted.pose is not None and spot.posture != wanted.pose:
            spot = spot.model_copy(update={"posture": wanted.pose})
        gestures = (wanted.gesture,) if wanted.gesture else self.rules[name].gestures
        clothes = (wanted.clothes_colour,) if wanted.clothes_colour else self.rules[name].clothes
        ranges = dict.fromkeys(("distance_m", "bearing_rad", "turned_rad", "pose"))
        self.change(name, poses=(spot,), gestures=gestures, clothes=clothes, **ranges)
        self.placed.add(name)
        return name

    def walks(self, word, goal, name):
        """Lets a person who stands follow the robot, or set out for the goal, by default for another room."""
        rule = self.rules.get(name)
        if rule is None or any(spot.posture != "standing" for spot in rule.stands):
            return
        if word == "guide":
            route = Route(follows="robot", speed=WALKS_M_S, yields=True)
        else:
            here = [one for one, outline in self.knowledge.rooms.items() if inside(outline, _at(rule))]
            others = [room for room in self.knowledge.rooms if room not in here]
            sets_out_s = SETS_OUT_S if name in self.named else FOUND_S
            to = goal if goal not in (None, START) else str(self.rng.choice(others))
            route = Route(waypoints=(to,), start=sets_out_s, speed=WALKS_M_S, says=None if goal else STOPS)
        self.change(name, route=route)

    def change(self, name, **update):
        self.rules[name] = self.rules[name].model_copy(update=update)

    def free(self, rule):
        """Rule without the spots that others have taken."""
        if rule.name in self.placed or not rule.poses:
            return rule
        apart = [one for one in rule.poses if all(math.dist((one.x, one.y), (t.x, t.y)) > 0.8 for t in self.taken)]
        return rule.model_copy(update={"poses": tuple(apart) or rule.poses})


def _at(rule):
    return (rule.stands[0].x, rule.stands[0].y) if rule.stands else (math.nan, math.nan)
