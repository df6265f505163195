"""Parts of the zoo: one table of who makes which campaigns, from one seed and a few sizes."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from virtual_lab import campaigns
from virtual_lab.campaigns import making

SHEET = Path("config", "cells.tsv")


class Part(NamedTuple):
    """A part: what its cells are, in words, and the module whose `make` writes them."""

    about: str
    module: str


PARTS = {
    "fast": Part("the laboratory's fast generator, other seed", "virtual_lab.zoo.parts"),
    "forms": Part("behavioural cells with other forms of the effects", "virtual_lab.zoo.forms"),
    "physics": Part("cells by physics, effects inside", "virtual_lab.zoo.physics_cells"),
    "planted": Part("real records with an effect planted", "virtual_lab.zoo.planted"),
}


def make(folder, *, seed: int, **sizes) -> None:
    """The laboratory's hidden campaign, `sizes` as its options, made in this process."""
    plan = campaigns.plan("hidden", seed=seed, **sizes)
    for batch in plan.batches():
        making.make_batch(plan, batch, Path(folder))
    making.make_sheets(plan, Path(folder))


def make_part(part: str, folder, *, seed: int, real="", **sizes) -> str:
    """Make the campaign or campaigns of a part.

    Parameters
    ----------
    part : a name of PARTS. folder : where. seed : of all that is drawn.
    real : folder of real campaigns, of part "planted"; `sizes["names"]` says which.
    sizes : as the part's `make` takes them.

    Returns
    -------
    Why it was not made; empty where it was.
    """
    module = PARTS[part].module
    if find_spec(module) is None:
        return f"there is no {module} yet"
    maker = import_module(module).make
    if part != "planted":
        maker(folder, seed=seed, **sizes)
        return ""
    there = [name for name in sizes["names"] if (Path(real) / name / SHEET).is_file()]
    for name in there:
        maker(Path(real) / name, (), Path(folder) / name, seed=seed)
    return "" if there else f"no campaign of real cells in {real}"


def campaigns_of(folder) -> list[Path]:
    """Campaigns of a part: the folder itself, or those in it, by name."""
    folder = Path(folder)
    inside = sorted(path.parents[1] for path in folder.glob(f"*/{SHEET}"))
    return [folder] if (folder / SHEET).is_file() else inside
