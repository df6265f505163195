"""Artefacts: what is saved is loaded, reasons are passed on, the contract is held."""

import importlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cellwright.messages import Said, doubt_columns, doubts_in
from cellwright.refusal import Refusal
from cellwright.series.doubts import Doubt
from cellwright_fmu.unit import archive
from runtime import artefact, contract, job_inputs

CURVE = {name: np.array([1.0, 2.0]) for name in contract.stages()["ica_curve"]["columns"]}
PATH = "results/stages/ica_curve/A/t.parquet"


def _saved(snakemake, path=PATH, content=CURVE, **facts):
    with artefact.Job(snakemake(path)) as job:
        job.save(content, **facts)
    return path


def _refused(snakemake, path=PATH, reason="no charge in the record"):
    with artefact.Job(snakemake(path)):
        raise Refusal(reason)
    return path


def test_columns_come_back_as_they_were(snakemake):
    loaded = artefact.load(_saved(snakemake, quality=np.float64(0.5)))
    assert list(loaded) == list(CURVE)
    assert np.array_equal(loaded["voltage_volt"], CURVE["voltage_volt"])
    assert artefact.read_about(PATH)["facts"] == {"quality": 0.5}


def test_same_content_gives_same_bytes(snakemake):
    first = Path(_saved(snakemake)).read_bytes()
    Path(PATH).unlink()
    assert Path(_saved(snakemake)).read_bytes() == first


def test_provenance_holds_inputs_and_no_absolute_path(snakemake, tmp_path):
    Path("raw.csv").write_text("1")
    with artefact.Job(snakemake(PATH, inputs=["raw.csv"], delay=10)) as job:
        job.save(CURVE)
    about = artefact.read_about(PATH)
    assert list(about["inputs"]) == ["raw.csv"]
    assert len(about["inputs"]["raw.csv"]) == 64
    assert about["params"]["delay"] == 10
    assert str(tmp_path) not in json.dumps(about)


def test_refusal_is_written_and_passed_on_with_its_origin(snakemake):
    _refused(snakemake)
    later = "results/stages/ica_curve/A/later.parquet"
    with artefact.Job(snakemake(later)) as job:
        job.load(PATH)
    about = artefact.read_about(later)
    assert about["reason"] == "no charge in the record"
    assert about["origin"] == PATH
    assert Path("job.log").read_text().count("no charge") == 2


def test_internal_error_costs_only_its_own_artefact(snakemake, capsys):
    with artefact.Job(snakemake(PATH)):
        _ = 1 / 0
    assert artefact.read_about(PATH)["reason"].startswith(
        "Cellwright itself failed at this step (ZeroDivisionError: division by zero): a fault"
    )
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("passing", [OSError(27, "File too large"), MemoryError()])
def test_what_may_pass_fails_the_job_so_that_it_is_made_again(snakemake, passing):
    with pytest.raises(type(passing)), artefact.Job(snakemake(PATH)):
        raise passing
    assert not Path(PATH).exists()
    assert "Traceback" in Path("job.log").read_text()
    with pytest.raises(type(passing)):
        artefact.failure(passing)


def test_a_disk_that_is_full_when_an_artefact_is_written_fails_the_job(snakemake, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(artefact.pq, "write_table", full)
    with pytest.raises(OSError, match="No space left"), artefact.Job(snakemake(PATH)) as job:
        job.save(CURVE)
    assert not Path(PATH).exists()


def test_interrupt_is_not_swallowed(snakemake):
    with pytest.raises(KeyboardInterrupt), artefact.Job(snakemake(PATH)):
        raise KeyboardInterrupt


def test_output_saved_before_a_refusal_is_kept(snakemake):
    second = "results/stages/ica_curve/A/second.parquet"
    with artefact.Job(snakemake(PATH, second)) as job:
        job.save(CURVE, PATH)
        raise Refusal("second part impossible")
    assert len(artefact.load(PATH)["voltage_volt"]) == 2
    with pytest.raises(artefact.Passed, match="second part impossible"):
        artefact.load(second)


def test_rows_and_columns_are_the_same_content(snakemake):
    _saved(snakemake, content=artefact.rows(CURVE))
    assert np.array_equal(artefact.load(PATH)["voltage_volt"], CURVE["voltage_volt"])


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"voltage_volt": [1.0]}, "ampere_hour is missing"),
        (CURVE | {"volt": [1.0, 2.0]}, "volt is not in the contract"),
    ],
)
def test_contract_is_held(columns, said):
    with pytest.raises(ValueError, match=said):
        contract.check("ica_curve", columns)


def test_range_of_the_contract_names_the_row():
    columns = {name: np.zeros(2) for name in contract.stages()["ocv"]["columns"]}
    columns["soc"] = np.array([0.5, 1.5])
    said = r"^ocv: row 2: soc is 1\.5, wanted 0 to 1; none of it is published$"
    with pytest.raises(Refusal, match=said):
        contract.check("ocv", columns)


CAPACITY = {name: np.ones(3) for name in contract.stages()["capacity"]["columns"]}


def test_a_row_out_of_its_range_is_left_out_and_told_and_the_others_stand(snakemake):
    path = "results/stages/capacity/A/t.parquet"
    wrong = CAPACITY | {"capacity_ampere_hour": np.array([1.0, -2.0, 3.0])}
    with artefact.Job(snakemake(path)) as job:
        job.save(wrong, left_out=["row 9 of the file"])
    said = "left out of capacity: row 2: capacity_ampere_hour is -2 Ah, wanted at least 0"
    assert artefact.load(path)["capacity_ampere_hour"].tolist() == [1.0, 3.0]
    about = artefact.read_about(path)
    assert about["facts"]["left_out"] == ["row 9 of the file", said]
    assert about["notes"] == [said]
    assert about["reason"] is None


def test_rows_of_several_columns_are_left_out_in_a_sentence_each():
    wrong = CAPACITY | {
        "capacity_ampere_hour": [-1.0, -2.0, np.nan],
        "repeats": np.array([1, 0, 3]),
        "direction": ["a", "b", "c"],
    }
    columns, left_out = contract.admitted("capacity", wrong)
    assert columns["direction"] == ["c"]
    assert np.isnan(columns["capacity_ampere_hour"][0]), "what is not known breaks no range"
    assert left_out == [
        "left out of capacity: 2 rows, the first: row 1: capacity_ampere_hour is -1 Ah, wanted at "
        "least 0",
        "left out of capacity: row 2: repeats is 0, wanted at least 1",
    ]
    with pytest.raises(Refusal, match="wanted at least 0; no row is left"):
        contract.admitted("capacity", CAPACITY | {"capacity_ampere_hour": -np.ones(3)})


def test_a_series_out_of_its_range_is_refused_whole(snakemake):
    path = "results/stages/ocv/A/t.parquet"
    columns = {name: np.zeros(2) for name in contract.stages()["ocv"]["columns"]}
    with artefact.Job(snakemake(path)) as job:
        job.save(columns | {"soc": np.array([0.5, 1.5])})
    reason = artefact.read_about(path)["reason"]
    assert reason == "ocv: row 2: soc is 1.5, wanted 0 to 1; none of it is published"


def test_families_of_columns_are_known():
    names = contract.stages()["pack_series"]["columns"]
    columns = {name: np.zeros(1) for name in names if "<" not in name}
    contract.check("pack_series", columns | {"branch_3_current_ampere": np.zeros(1)})
    series = {name: np.zeros(1) for name in ("test_time_second", "current_ampere", "voltage_volt")}
    contract.check("ingest", series | {"surface_temperature_2_celsius": np.zeros(1)})


def test_json_documents_carry_their_provenance_inside(snakemake):
    path = _saved(snakemake, "results/models/A.json", {"cell": "A", "value": np.nan})
    document = json.loads(Path(path).read_text())
    assert document["cell"] == "A"
    assert document["value"] is None
    assert document["provenance"]["rule"] == "toy"
    assert artefact.load(path) == {"cell": "A", "value": None}


def test_a_document_that_was_written_again_is_read_again(snakemake):
    for value in (1, 22):
        path = _saved(snakemake, "results/models/A.json", {"value": value})
        assert artefact.load(path) == {"value": value}


def test_tables_have_the_columns_of_the_contract_even_without_rows(snakemake):
    path = "results/tables/validation.csv"
    _saved(snakemake, path, [])
    header = Path(path).read_text().strip().split(",")
    assert header == list(contract.stages()["tables/validation"]["columns"])
    assert artefact.load_table(path) == []


def test_cells_of_tables_are_plain(snakemake):
    path = "results/tables/excluded.csv"
    row = {"cell": "A", "test": None, "file": "x", "stage": "ocv", "reason": 'says "no", why'}
    _saved(snakemake, path, [row])
    assert artefact.load_table(path)[0] == row | {"test": ""}


def test_units_for_simulators_carry_their_provenance_among_their_extras(snakemake):
    unit = archive({"modelDescription.xml": b"<fmi/>"})
    path = _saved(snakemake, "results/models/A.fmu", unit, token="abc")
    first = Path(path).read_bytes()
    with zipfile.ZipFile(path) as packed:
        assert packed.read("modelDescription.xml") == b"<fmi/>"
    about = artefact.read_about(path)
    assert (about["rule"], about["reason"], about["facts"]) == ("toy", None, {"token": "abc"})
    _saved(snakemake, path, unit, token="abc")
    assert Path(path).read_bytes() == first
    refused = _refused(snakemake, "results/models/B.fmu", "no member")
    assert artefact.read_about(refused)["reason"] == "no member"


def test_refused_figure_says_why(snakemake):
    _refused(snakemake, "results/figures/A/ica.svg", "no peaks < 3 V")
    assert "no peaks &lt; 3 V" in Path("results/figures/A/ica.svg").read_text()


def test_load_some_passes_the_reason_on_where_nothing_has_content(snakemake):
    _refused(snakemake)
    with pytest.raises(artefact.Passed, match="no charge"):
        artefact.load_some([PATH])


def test_load_together_keeps_pairs(snakemake):
    _saved(snakemake)
    bad = _refused(snakemake, "results/stages/ica_curve/A/bad.parquet")
    found = artefact.load_together([(PATH, bad), (PATH, PATH)])
    assert len(found) == 1


def test_what_is_hidden_cannot_be_imported_and_can_be_afterwards():
    sys.modules.pop("colorsys", None)
    with artefact.without("colorsys"), pytest.raises(ModuleNotFoundError, match="not looked for"):
        importlib.import_module("colorsys")
    assert importlib.import_module("colorsys").rgb_to_yiq(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)


def test_a_job_that_makes_no_table_for_people_imports_no_pandas():
    code = (
        "import sys; from runtime import artefact, job_inputs, tables; "
        "assert not {'pandas', 'matplotlib', 'lmfit'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


FIRST, SECOND, THIRD = (
    f"results/stages/{stage}/A/t.parquet" for stage in ("ingest", "clean", "ica_curve")
)
SERIES = {name: np.zeros(2) for name in ("test_time_second", "current_ampere", "voltage_volt")}


def _steps(snakemake, *, first=SERIES, third=CURVE):
    """A job of three steps, of which the second reads the first and the third reads nothing."""
    job = snakemake(FIRST, SECOND, THIRD)
    with artefact.Job(job, FIRST) as one:
        one.note("of the first step")
        one.save(first)
    with artefact.Job(job, SECOND, after=one) as two:
        two.save(two.load(FIRST) | {"charge_ampere_hour": np.zeros(2)})
    with artefact.Job(job, THIRD, inputs=[]) as three:
        three.save(third)


def test_a_step_takes_the_outcome_of_the_step_before_as_its_file_holds_it(snakemake):
    job = snakemake(FIRST, SECOND)
    with artefact.Job(job, FIRST) as one:
        one.save({name: values.tolist() for name, values in SERIES.items()})
    with artefact.Job(job, SECOND, after=one) as two:
        handed, read = two.load(FIRST), artefact.load(FIRST)
    assert list(handed) == list(read)
    for name, values in read.items():
        assert handed[name].dtype == values.dtype
        assert np.array_equal(handed[name], values)


def test_a_refusal_in_a_step_reaches_those_that_need_it_and_no_other(snakemake):
    job = snakemake(FIRST, SECOND, THIRD)
    with artefact.Job(job, FIRST):
        raise Refusal("empty file")
    with artefact.Job(job, SECOND) as two:
        two.load(FIRST)
    with artefact.Job(job, THIRD) as three:
        three.save(CURVE)
    abouts = [artefact.read_about(path) for path in (FIRST, SECOND, THIRD)]
    assert [about["reason"] for about in abouts] == ["empty file", "empty file", None]
    assert [about["origin"] for about in abouts] == [FIRST, FIRST, None]


def test_each_step_has_its_own_notes_inputs_and_name(snakemake):
    _steps(snakemake)
    abouts = [artefact.read_about(path) for path in (FIRST, SECOND, THIRD)]
    assert [about["notes"] for about in abouts] == [["of the first step"], [], []]
    assert [about["step"] for about in abouts] == ["ingest", "clean", "ica_curve"]
    log = Path("job.log").read_text().splitlines()
    assert log == [FIRST, "of the first step", SECOND, THIRD]


def test_an_internal_error_in_a_step_costs_no_other_step(snakemake, capsys):
    _steps(snakemake, third={"volt": np.zeros(2)})
    assert artefact.read_about(SECOND)["reason"] is None
    assert artefact.read_about(THIRD)["reason"].startswith(artefact.FAILED)
    assert "Traceback" in capsys.readouterr().err


def made(path, test=None, **about):
    """An artefact of cell A with these facts beside it."""
    wildcards = {"cell": "A"} | ({"test": test} if test else {})
    artefact.write(path, {"soc": np.array([1.0])}, {"wildcards": wildcards} | about)
    return path


def test_a_doubt_moves_what_is_fitted_to_its_record_or_made_of_its_number_and_nothing_further(
    snakemake,
):
    """A spectrum and a capacity in doubt move no row of a model; a pulse test that it is fitted to
    does, and so does one of its capacity tests what is read off it."""
    stages = "results/stages"
    doubts = [{"doubts": {f"A {test}": f"{test} is wrong"}} for test in ("pulses", "size", "eis")]
    clean = made(f"{stages}/clean/A/pulses.parquet", "pulses", **doubts[0])
    size = made(f"{stages}/capacity/A/size.parquet", "size", **doubts[1])
    spectrum = made(f"{stages}/eis/A/eis.parquet", "eis", **doubts[2])
    before = made(f"{stages}/course/A.parquet", **doubts[1], records=["A size"])

    def behind(*paths):
        about = artefact.behind(paths)
        doubts = job_inputs.doubts_behind({"wildcards": {"cell": "A", "test": "drive"}} | about)
        return about, "; ".join(doubts)

    about, words = behind(size, spectrum)
    assert set(words.split("; ")) == {"A size: size is wrong", "A eis: eis is wrong"}
    basis = made(f"{stages}/basis/A.json", **about)
    about, words = behind(basis, clean)
    assert words == "A pulses: pulses is wrong"
    assert len(about["doubts"]) == 3  # all are known, by lineage
    model = made("results/models/A.json", **about)
    assert behind(model)[1] == "A pulses: pulses is wrong"
    assert behind(before)[1] == ""
    score = made(f"{stages}/validation/A/drive.parquet", "drive", **behind(model)[0])
    shown = job_inputs.doubts_behind(artefact.read_about(score))
    assert shown == ["A pulses: pulses is wrong"]
    assert job_inputs.doubts_behind(artefact.read_about(score), {"pulses"}) == []
    own = {"doubts": {"A pulses": "pulses is wrong", "A drive": "it drifts"}}
    score = made(f"{stages}/validation/A/drive.parquet", "drive", **behind(model)[0] | own)
    assert job_inputs.own_doubts(artefact.read_about(score)) == ["it drifts"]
    searched = made("results/missing_effect/A/model.json", doubts={}, records=["A eis"])
    assert artefact.behind([searched])["records"] == []


def test_a_doubt_has_its_code_from_the_record_to_every_table_behind_it(snakemake):
    """Of rows with several sentences each keeps its own; what a test is known for is told once."""
    stages = "results/stages"
    told = {"doubt": np.array(["", "it drifts; it is coarse"]), "soc": np.zeros(2)}
    told["doubt_codes"] = np.array(["", "capacity.drifts;capacity.coarse"])
    assert artefact.doubts_told(told, "eis") == ["it drifts", "it is coarse"]
    flags = {"doubt": np.array([0, Doubt.CLOCK | Doubt.SIGN], np.int16)}
    assert [one.code for one in artefact.doubts_told(flags, "clean")] == ["row.clock", "row.sign"]
    path = made(f"{stages}/clean/A/pulses.parquet", "pulses")
    about = {"doubts": {"A pulses": "it drifts; it is coarse"}}
    about["doubt_codes"] = {"A pulses": "capacity.drifts;capacity.coarse"}
    made(path, "pulses", **about)
    of_drive = {"wildcards": {"cell": "A", "test": "drive"}} | artefact.behind([path])
    found = doubt_columns(job_inputs.doubts_behind(of_drive))
    assert found["doubt"] == "A pulses: it drifts; A pulses: it is coarse"
    assert found["doubt_codes"] == "capacity.drifts;capacity.coarse"


def test_an_entry_of_a_column_of_doubts_holds_no_separator():
    (entry,) = doubts_in(doubt_columns([Said("a rest; a load", "half.by_rest")]))
    assert (entry, entry.code) == ("a rest, a load", "half.by_rest")
    with pytest.raises(ValueError, match="zip"):
        doubts_in({"doubt": "a; b", "doubt_codes": "one"})
