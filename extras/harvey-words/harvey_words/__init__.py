"""Words for Harvey: route instructions of people, read on the model of a building."""

from harvey_words.directions.directions import Directions as Directions
from harvey_words.directions.directions import write_directions as write_directions
from harvey_words.following.reading import RouteEnd as RouteEnd
from harvey_words.following.reading import Reading as Reading
from harvey_words.following.reading import RouteError as RouteError
from harvey_words.following.reading import read_route as read_route
