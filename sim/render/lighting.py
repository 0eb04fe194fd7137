"""The ``[light]`` table of a scenario: lamps, daylight, shiny and coloured surfaces, and the camera's adaption."""

from __future__ import annotations

import math
from dataclasses import dataclass

from world_models.units import Bounded, bounded

GAMMA = 2.2
"""Colours are as seen: light is their power of this, relative to a white surface at full light."""
MAX_LAMP_COLOUR = 4.0
UNEVEN = ("lamps", "sky", "sun", "floor_gloss", "glass", "wall_colours", "traced_paths")
"""With one of these light differs from place to place, or is reflected."""


@dataclass(frozen=True, slots=True)
class Lighting(Bounded):
    """Where light comes from, what it falls on, and how the camera adapts.

    Light is relative: a white surface at irradiance 1 is seen at full brightness by a camera of gain 1.

    Attributes:
        flat: share of the light that a building has without ``[light]``: without lamps, shadows and bounces.
        lamps: irradiance below ceiling panels where all of them are on, without what walls reflect.
        lamps_off: share of the panels that are off.
        lamp_spacing_m: about the distance of a room's panels.
        lamp_colour: red, green and blue of their light.
        sky: radiosity of window panes.
        sun: irradiance of a surface that faces the sun.
        sun_azimuth_rad: direction to the sun, from the world's x axis to its y axis.
        sun_elevation_rad: of the sun above the horizon.
        floor_gloss: 0: floors are matt; 1: they reflect as polished stone does.
        glass: 0: panes reflect nothing; 1: they reflect as glass before something dark does.
        wall_colours: how strongly the walls of each room have another colour than in the model.
        bounces: how often light is reflected.
        rays: over which the light that a place receives from other surfaces is averaged.
        cell_m: distance of the places for which light is computed.
        seed: of the lamps that are off and the walls' colours.
        exposure_lag_s: time constant of auto exposure; 0: the exposure is fixed.
        white_balance_lag_s: time constant of auto white balance; 0: it is fixed.
        vignetting: how much darker the corners of the picture are, as a share of the light.
        traced_paths: paths per pixel of the reference, a path tracer; 0: the fast renderer.
    """

    flat: float = bounded(0.0, 0.0, 1.0)
    lamps: float = bounded(1.0, 0.0, 100.0)
    lamps_off: float = bounded(0.0, 0.0, 1.0)
    lamp_spacing_m: float = bounded(2.4, 0.7, 20.0)
    lamp_colour: tuple[float, ...] = (1.0, 1.0, 1.0)
    sky: float = bounded(0.0, 0.0, 100.0)
    sun: float = bounded(0.0, 0.0, 100.0)
    sun_azimuth_rad: float = bounded(0.0, -2.0 * math.pi, 2.0 * math.pi)
    sun_elevation_rad: float = bounded(0.6, 0.0, math.pi / 2.0)
    floor_gloss: float = bounded(0.0, 0.0, 1.0)
    glass: float = bounded(0.0, 0.0, 1.0)
    wall_colours: float = bounded(0.0, 0.0, 1.0)
    bounces: int = bounded(3, 0, 10)
    rays: int = bounded(48, 1, 4096)
    cell_m: float = bounded(0.35, 0.05, 10.0)
    seed: int = bounded(0, 0, 10**9)
    exposure_lag_s: float = bounded(0.4, 0.0, 100.0)
    white_balance_lag_s: float = bounded(0.0, 0.0, 100.0)
    vignetting: float = bounded(0.0, 0.0, 1.0)
    traced_paths: int = bounded(0, 0, 65536)

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        if len(self.lamp_colour) != 3 or not all(0.0 <= part <= MAX_LAMP_COLOUR for part in self.lamp_colour):
            raise ValueError(f"expected lamp_colour of three numbers from 0 to {MAX_LAMP_COLOUR:g},"
                             f" got {list(self.lamp_colour)}")

    @property
    def uneven(self) -> tuple[str, ...]:
        """Which of its keys make light differ from place to place; none where it is flat."""
        return tuple(key for key in UNEVEN if getattr(self, key))

    @property
    def towards_sun(self) -> tuple[float, float, float]:
        """The unit direction to the sun in the world frame."""
        level = math.cos(self.sun_elevation_rad)
        return (level * math.cos(self.sun_azimuth_rad), level * math.sin(self.sun_azimuth_rad),
                math.sin(self.sun_elevation_rad))
