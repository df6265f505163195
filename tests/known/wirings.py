"""Wirings of packs, from a star to three groups one in the other."""

import truth

from cellwright.bias.scaled import scaled_reference
from cellwright.packs.wiring import Wiring

# Three unequal cells on one OCV: B the smallest and most resistive, C the largest.
UNEQUAL = (
    truth.model("A"),
    scaled_reference(truth.model(), cell="B", capacity=1.6, resistance_ratio=1.7),
    scaled_reference(truth.model(), cell="C", capacity=2.3, resistance_ratio=0.8),
)


def parallel(*members, link=0.0, terminals="same_end", contact=0.0, name="p"):
    links = (0.0, *[link] * (len(members) - 1))
    return Wiring(name, "parallel", members, (contact,) * len(members), links, terminals)


def series(*members, contact=0.0, name="s"):
    count = len(members)
    return Wiring(name, "series", members, (contact,) * count, (0.0,) * count)


WIRINGS = {
    "star": parallel(*"ABCDE", contact=1e-3),
    "star without contacts": parallel(*"ABCDE"),
    "ladder": parallel(*"ABCDE", link=5e-4),
    "ladder with contacts": parallel(*"ABCDE", link=5e-4, contact=1e-3),
    "leads at opposite ends": parallel(*"ABCDE", link=5e-4, terminals="opposite_ends"),
    "two at opposite ends": parallel(*"AB", link=5e-3, terminals="opposite_ends"),
    "series": series(*"ABCDE", contact=1e-3),
    "series of groups": series(parallel(*"AB"), "C", parallel(*"DEF", link=1e-3), contact=2e-3),
    "strings in parallel": parallel(series(*"ABC"), series(*"DEF"), link=1e-3, contact=1e-3),
    "three deep": parallel(
        series(parallel(*"AB", link=2e-3, terminals="opposite_ends"), "C"),
        series("D", parallel(*"EF", link=1e-3)),
        series(*"GH"),
        link=3e-3,
        terminals="opposite_ends",
    ),
    "one": series("A"),
}
