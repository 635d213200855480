"""A world of three surfaces with a known best plan.

Soles are 0.22 m long and steps of the table at most 0.4 m, to which the search may add 0.06 m. A foot on the start
platform stands at x <= 0.14 m, on the stone between 0.46 and 0.64 m, behind it at x >= 0.89 m. So the stone cannot be
reached with the first step, and the goal not from it with both feet in fewer than four: one on the start, one on the
stone, two behind it.
"""

from toolkit.contacts.sequence import ContactSequence
from toolkit.world.authoring import WorldText
from toolkit.world.loader import load_world
from toolkit.world.world import World

BEST = ["platform_start", "stone", "platform_goal", "platform_goal"]


def three_surfaces() -> World:
    text = WorldText("three_surfaces", "a stone between two platforms", 0.6, (0.6, 0.8), (1.06, 0.0, 0.0))
    text.platform("platform_start", (-0.6, 0.25), 1.2)
    text.tile("stone", (0.4, 1.0), (0.55, 0.0, 0.0))
    text.platform("platform_goal", (0.78, 1.8), 1.2)
    return load_world("three_surfaces.xml", mjcf=text.render())


def visited(world: World, sequence: ContactSequence) -> list[str]:
    return [
        world.surfaces[transition.contact.surface].geom for transition in sequence.transitions if transition.contact
    ]
