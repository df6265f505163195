"""Where the story of the gap ends: the model in use, and which of its parts hold what was named."""

from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import why_no_part
from cellwright.effects.story.messages import say
from cellwright.effects.story.places import millivolt
from cellwright.identification.messages import say as say_of_model
from cellwright.identification.particle import WITHOUT
from cellwright.messages import listed


def part_of(effect, own):
    """What the part that an effect is of the model in use is worth there, from its verdict: dict of
    `in_use.with_parts`; {} where the effect is none, or the model no particle.

    Parameters
    ----------
    effect : id. own : dict, verdict on the model in use, or None.
    """
    parts = ((own or {}).get("in_use") or {}).get("parts") or ()
    name = LIBRARY[effect].in_particle if effect in LIBRARY else ""
    return next((one for one in parts if one["part"] == name), {})


def sentences_in_use(verdict, own):
    """Sentences on the model in use: its error on the tests of the search, which parts of a
    particle hold what was named, and where search and model contradict each other.

    A part is not missed among the names where it shares a parameter with one that is: charge
    transfer is a part of what acts at once and of what relaxes.

    Parameters
    ----------
    verdict : dict of the contract, of the plain circuit. own : dict, of the model in use, or None.

    Returns
    -------
    sentences : list of str.
    """
    known = (own or {}).get("in_use")
    if not known:
        return []
    errors = {side: millivolt(volt) for side, volt in own["as_given_rmse_volt"].items()}
    told = [say("in_use.errs", model=known["model"], **errors)]
    if not known["parts"]:
        return told
    named = [*verdict["effects"], *verdict.get("partial", ())]
    tied = {name for one in named for name in one["alternatives"]}
    named = {one["effect"] for one in named}
    entries = [effect for name, effect in LIBRARY.items() if name in named | tied]
    claimed = set().union(*(WITHOUT.get(effect.in_particle, ()) for effect in entries))
    # Beside healthy cells a search asks for what differs from them; some effects no test shows it.
    unasked = LIBRARY if verdict.get("references") else verdict.get("not_testable", ())
    said = {"held": [], "worthless": [], "unnamed": [], "no_part": []}
    for effect in LIBRARY.values():
        part = part_of(effect.id, own)
        if effect.id in named and not effect.in_particle:
            why = why_no_part(effect)
            said["no_part"].append(say("in_use.absent", name=effect.short, why=why))
        elif part and effect.id in named:
            said["held" if part["worth"] else "worthless"].append(_in_words(effect, part))
        elif effect.id in unasked or not part.get("worth"):
            continue
        elif claimed.isdisjoint(WITHOUT[part["part"]]):
            claimed |= set(WITHOUT[part["part"]])
            against = (verdict.get("against") or {}).get(effect.id)
            said["unnamed"].append(_in_words(effect, part, against))
    error = millivolt(known["left_out_rmse_volt"])
    return told + [
        say(f"in_use.{code}", parts=listed(parts), error=error)
        for code, parts in said.items()
        if parts
    ]


def _in_words(effect, part, against=None):
    """An effect, what a part is worth that it is, and why the search does not name it."""
    return say(
        "in_use.part_against" if against else "in_use.part",
        name=effect.short,
        part=say_of_model(f"part.{part['part']}"),
        without=millivolt(part["left_out_rmse_volt"]),
        why=say(f"against.{against}") if against else "",
    )
