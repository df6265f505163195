"""A run as a Provenance Run Crate: which job made which file of what, for other people's tools.

RO-Crate 1.1 with the Workflow Run profiles 0.5 (process, workflow, provenance) and Workflow
RO-Crate 1.0: Leo et al., Recording provenance of workflow runs with RO-Crate, PLOS ONE 19 (2024).
The root of the crate is `results/`; raw files lie outside and stand in it by name and SHA-256.
"""

import hashlib
import re
from pathlib import Path
from urllib.parse import quote

from runtime import lineage, provenance

PROFILES = [
    *(f"https://w3id.org/ro/wfrun/{name}/0.5" for name in ("process", "workflow", "provenance")),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
]
# Terms of the workflow-run vocabulary that the profile names beside those of RO-Crate 1.1.
TERMS = {"sha256": "https://w3id.org/ro/terms/workflow-run#sha256"}
MEDIA = {
    "": "text/plain",  # Snakefile
    ".csv": "text/csv",
    ".fmu": "application/zip",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".parquet": "application/vnd.apache.parquet",
    ".smk": "text/plain",
    ".svg": "image/svg+xml",
    ".tsv": "text/tab-separated-values",
    ".yaml": "application/yaml",
}
MAIN, RUN = "stages/workflow/Snakefile", "#run"
SNAKEMAKE = "https://snakemake.github.io"
LANGUAGE = "https://w3id.org/workflowhub/workflow-ro-crate#snakemake"
MIT = "https://spdx.org/licenses/MIT"


def crate(digests, rules, about) -> dict:
    """The metadata document of a run.

    Parameters
    ----------
    digests : SHA-256 of files of the results, by their path from the campaign's folder
    rules : of each rule, what a job of it does in words and its script's path in the repository
    about : title, published (date), license, authors, citations, snakemake (version), command;
        ended, function of a file's path: when its job ended, None where that is not known
    """
    jobs, files, raw = {}, {}, {}
    ahead = sorted(digests.items())
    while ahead:
        path, digest = ahead.pop()
        if _id(path) in files:
            continue
        files[_id(path)] = _file(path, digest)
        made = lineage.about_of(path)
        if made is None:
            continue
        key = (made["rule"], *sorted(made["wildcards"].items()))
        job = jobs.setdefault(key, {"about": made, "inputs": {}, "outputs": [], "ended": None})
        job["ended"] = job["ended"] or about["ended"](path)
        job["inputs"] |= made["inputs"]
        job["outputs"].append(_id(path))
        for source, digest in made["inputs"].items():
            if source.startswith("results/"):
                ahead.append((source, digest))
            else:
                raw[_id(source)] = _file(source, digest)
    files, raw = dict(sorted(files.items())), dict(sorted(raw.items()))
    main = files.pop(MAIN)
    codes = {key[0]: job["about"]["code"] for key, job in sorted(jobs.items())}
    used = list(codes)
    tools = {rule: _tool_id(rule, rules.get(rule, {})) for rule in used}
    graph = [
        _descriptor(),
        _root(about, files, jobs),
        *(_profile(identity) for identity in PROFILES),
        main | _workflow(tools, about),
        _engine(about),
        *(_tool(rule, tools[rule], code, rules.get(rule, {})) for rule, code in codes.items()),
        *(_step(rule, tools[rule], place) for place, rule in enumerate(used)),
        *_run(about, jobs, files, raw),
        *(_action(key, job, tools[key[0]], about) for key, job in sorted(jobs.items())),
        *files.values(),
        *raw.values(),
        *_people(about),
    ]
    return {"@context": ["https://w3id.org/ro/crate/1.1/context", TERMS], "@graph": graph}


def _id(path) -> str:
    """Identity of a file: its path below `results/`; of one outside, its name behind `#`."""
    path = Path(path).as_posix()
    return path.removeprefix("results/") if path.startswith("results/") else f"#{path}"


def _file(path, digest) -> dict:
    """A file: part of the crate below `results/`, else what was read from elsewhere."""
    identity, suffix = _id(path), Path(path).suffix
    inside = not identity.startswith("#")
    entity = {"@id": identity, "@type": "File" if inside else "CreativeWork"}
    entity |= {"name": Path(path).as_posix(), "sha256": digest}
    if suffix in MEDIA and inside:
        entity["encodingFormat"] = MEDIA[suffix]
    if identity == "README.md":
        entity["about"] = {"@id": "./"}
    return entity


def _of(identities):
    """References to entities; to one alone without a list, as RO-Crate 1.1 wants it."""
    found = [{"@id": identity} for identity in identities]
    return found[0] if len(found) == 1 else found


def _descriptor() -> dict:
    conforms = ["https://w3id.org/ro/crate/1.1", PROFILES[-1]]
    return {
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "about": {"@id": "./"},
        "conformsTo": _of(conforms),
    }


def _root(about, files, jobs) -> dict:
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": about["title"],
        "description": f"Results of a Cellwright run: {about['title']}.",
        "datePublished": about["published"],
        "license": {"@id": about["license"] or "#license"},
        "conformsTo": _of(PROFILES),
        "mainEntity": {"@id": MAIN},
        "mentions": _of([RUN, *map(_job_id, sorted(jobs))]),
        "hasPart": _of([MAIN, *files]),
    }
    if about["authors"]:
        root["author"] = _of(map(_person_id, about["authors"]))
    if about["citations"]:
        root["citation"] = _of(about["citations"])
    return root


def _profile(identity) -> dict:
    name, version = identity.split("/")[-2:]
    return {"@id": identity, "@type": "CreativeWork", "name": name, "version": version}


def _workflow(tools, about) -> dict:
    return {
        "@type": ["File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo"],
        "name": "Cellwright",
        "version": about["version"],
        "programmingLanguage": {"@id": LANGUAGE},
        "hasPart": _of(tools.values()),
        "step": _of(f"#step/{rule}" for rule in tools),
        "license": {"@id": MIT},
    }


def _engine(about) -> dict:
    return {
        "@id": LANGUAGE,
        "@type": ["ComputerLanguage", "SoftwareApplication"],
        "name": "Snakemake",
        "url": {"@id": SNAKEMAKE},
        "identifier": {"@id": SNAKEMAKE},
        "softwareVersion": about["snakemake"],
    }


def _tool_id(rule, words) -> str:
    """A tool's name anywhere: the SWHID (ISO/IEC 18670) of its script, by content and by path."""
    script = words.get("script")
    if not script:
        return f"#rule/{rule}"
    content = (provenance.SCRIPTS.parent / script).read_bytes()
    digest = hashlib.sha1(b"blob %d\0" % len(content) + content, usedforsecurity=False)
    return f"swh:1:cnt:{digest.hexdigest()};path=/{script}"


def _tool(rule, identity, code, words) -> dict:
    """The script of a rule, as what its jobs run; its version is the hash of all its code."""
    tool = {"@id": identity, "@type": "SoftwareApplication", "name": rule}
    tool["softwareVersion"] = code
    tool["description"] = re.sub(
        r"\{(?:wildcards\.)?(\w+)[^}]*\}", r"<\1>", words.get("does", rule)
    )
    return tool


def _step(rule, tool, place) -> dict:
    work = {"@id": tool}
    return {
        "@id": f"#step/{rule}",
        "@type": "HowToStep",
        "position": str(place),
        "workExample": work,
    }


def _run(about, jobs, files, raw) -> list[dict]:
    """The run as a whole, and the engine that ran its steps."""
    steps = [f"#control/{rule}" for rule in sorted({key[0] for key in jobs})]
    made = {output for job in jobs.values() for output in job["outputs"]}
    actions = {}
    for key in sorted(jobs):
        actions.setdefault(key[0], []).append(_job_id(key))
    controls = [
        {
            "@id": f"#control/{rule}",
            "@type": "ControlAction",
            "name": f"jobs of {rule}",
            "instrument": {"@id": f"#step/{rule}"},
            "object": _of(of_rule),
        }
        for rule, of_rule in actions.items()
    ]
    return [
        {
            "@id": RUN,
            "@type": "CreateAction",
            "name": f"run of {about['title']}",
            "description": about["command"],
            "endTime": about["published"],
            "instrument": {"@id": MAIN},
            "object": _of(sorted(raw)),
            "result": _of(sorted(made & set(files))),
            **_agent(about),
        },
        {
            "@id": "#engine",
            "@type": "OrganizeAction",
            "name": "Snakemake",
            "instrument": {"@id": LANGUAGE},
            "object": _of(steps),
            "result": {"@id": RUN},
            "endTime": about["published"],
            **_agent(about),
        },
        *controls,
    ]


def _job_id(key) -> str:
    rule, *wildcards = key
    return "/".join(["#job", rule, *(value for _, value in wildcards)])


def _agent(about) -> dict:
    """Who ran it, as far as the campaign states it: its authors."""
    return {"agent": _of(map(_person_id, about["authors"]))} if about["authors"] else {}


def _person_id(name) -> str:
    """A blank is no part of an identity."""
    return f"#{quote(name)}"


def _action(key, job, tool, about) -> dict:
    """A job: what it ran, what it read, what it made; a refusal is no failure of the job."""
    made = job["about"]
    action = {
        "@id": _job_id(key),
        "@type": "CreateAction",
        "name": " ".join([key[0], *(value for _, value in key[1:])]),
        "description": f"code {made['code']}, environment {made['environment_lock']}",
        "instrument": {"@id": tool},
        "object": _of(map(_id, sorted(job["inputs"]))),
        "result": _of(sorted(job["outputs"])),
        "actionStatus": "http://schema.org/CompletedActionStatus",
    }
    action |= {"endTime": job["ended"]} if job["ended"] else {}
    action |= {"disambiguatingDescription": made["reason"]} if made["reason"] else {}
    return action | _agent(about)


def _people(about) -> list[dict]:
    people = [
        {"@id": _person_id(name), "@type": "Person", "name": name} for name in about["authors"]
    ]
    people += [
        {"@id": source, "@type": "CreativeWork", "name": source} for source in about["citations"]
    ]
    stated = about["license"] or "#license"
    words = about["license"] or "not stated: publication.license in config.yaml"
    people.append({"@id": stated, "@type": "CreativeWork", "name": words})
    if stated != MIT:
        people.append({"@id": MIT, "@type": "CreativeWork", "name": "MIT License"})
    return people
