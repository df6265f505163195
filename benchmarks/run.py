"""Times Cellwright beside its peers, all in one run, and prints the tables: benchmarks/run.

benchmarks/run                      every topic
benchmarks/run simulation fit       only these
benchmarks/run --write              every topic, kept in benchmarks/measured.json
"""

import json
import sys
import warnings

import capacity_slope
import fit
import group
import impedance_fit
import reading
import simulation
import soc_filter
import start
from as_page import KEPT, measured, section, topic_measured
from timing import timed

from cellwright.native import function

TOPICS = {
    "simulation": (simulation.uniform, simulation.long_record, simulation.true_steps),
    "fit": (fit.hppc,),
    "filter": (soc_filter.adaptive,),
    "ica": (capacity_slope.topic,),
    "impedance": (impedance_fit.topic, impedance_fit.poor_start),
    "group": (group.star, group.ladder, group.chosen, group.hour),
    "reading": (reading.topic, reading.arbin),
    "start": (start.topic,),
}


def main(words):
    """Print the tables of the topics named, of all where none is; --write keeps them."""
    if function("lag") is None:
        sys.exit("benchmarks: no compiled kernels (no C compiler, or CELLWRIGHT_NATIVE=0)")
    # PyBOP's optimisers warn of what they do not use.
    warnings.simplefilter("ignore")
    chosen = [word for word in words if word != "--write"] or list(TOPICS)
    topics = []
    for maker in (maker for name in chosen for maker in TOPICS[name]):
        topic = maker()
        topics.append(topic_measured(topic, [timed(entry) for entry in topic.entries]))
        print(section(topics[-1]), flush=True)
    if "--write" in words:
        text = json.dumps(measured(topics), indent=1, ensure_ascii=False)
        KEPT.write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
