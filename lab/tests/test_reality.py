"""The check against reality finds in made records what was put into them."""

import csv
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from virtual_lab.reality import check, noise, records, responses
from virtual_lab.reality.records import Number, Record, Skipped, Source, load, named

SIGMA = 0.0004


def campaign(folder, tests):
    """A campaign of one 2 Ah cell; `tests` gives kind and (second, ampere, volt) by name."""
    (folder / "config").mkdir(parents=True)
    head = "cell\ttest\tkind\tfile\tambient_temperature_celsius\n"
    rows = [f"X\t{name}\t{kind}\t{name}.csv\t25\n" for name, (kind, _) in tests.items()]
    (folder / "config" / "tests.tsv").write_text(head + "".join(rows))
    cells = "cell\tchemistry\trated_capacity_ampere_hour\nX\tNMC\t2\n"
    (folder / "config" / "cells.tsv").write_text(cells)
    for name, (_, columns) in tests.items():
        lines = [f"{t:.4f},{i:.5f},{v:.6f}" for t, i, v in zip(*columns, strict=True)]
        text = "\n".join(["Test Time / s,Current / A,Voltage / V", *lines]) + "\n"
        (folder / f"{name}.csv").write_text(text)
    return Source("made", folder, False)


def loaded_then_rest(noise_volt=0.0):
    """300 s of rest, 900 s at −1 A, 4000 s of rest; 20 mΩ at once and 30 mΩ of 60 s after."""
    random = np.random.default_rng(5)
    second = np.concatenate([np.arange(0, 1300.0, 1.0), np.arange(1300.0, 5200.0, 10.0)])
    loaded = (second > 300) & (second <= 1200)
    slow = np.where(second > 300, -0.03 * (1 - np.exp(-(second - 300) / 60)), 0)
    slow = np.where(second > 1200, -0.03 * np.exp(-(second - 1200) / 60), slow)
    volt = 3.7 + slow - 0.02 * loaded + random.normal(0, noise_volt, second.size)
    return second, -1.0 * loaded, volt


@pytest.mark.parametrize("drift", [0.0, 1e-5])
def test_white_noise_is_found_under_a_drift(drift):
    values = np.random.default_rng(0).normal(0, SIGMA, 20000) + drift * np.arange(20000)
    assert noise.white_level(values) == pytest.approx(SIGMA, rel=0.03)


def test_spectrum_of_white_noise_is_flat_at_its_density():
    """Standard deviation s at an interval d has the one-sided density s √(2 d)."""
    values = np.random.default_rng(1).normal(0, SIGMA, 40000)
    hertz, density = noise.spectrum(values, 2.0)
    assert hertz[-1] == pytest.approx(0.25)
    assert np.median(density[5:-1]) == pytest.approx(SIGMA * 2.0, rel=0.1)
    assert density[5:100].mean() == pytest.approx(density[-100:-1].mean(), rel=0.1)


@pytest.mark.parametrize("step", [0.0003, 0.000161943, 0.000645])
def test_step_of_an_instrument_is_found(step):
    values = 3.7 + np.random.default_rng(2).normal(0, 0.003, 3000)
    assert noise.resolution(np.round(values / step) * step) == pytest.approx(step, rel=1e-3)


def test_values_on_no_grid_have_no_step():
    assert np.isnan(noise.resolution(np.random.default_rng(3).normal(3.7, 0.01, 3000)))


def test_slow_noise_is_told_from_white():
    random = np.random.default_rng(4)
    white = random.normal(0, SIGMA, 4000)
    slow = np.convolve(random.normal(0, SIGMA, 4099), np.ones(100) / 10, "valid")
    assert noise.slow_share(white) == pytest.approx(1, abs=0.15)
    assert noise.slow_share(white + slow) > 2


def test_clocks_that_keep_to_a_grid_are_told_from_those_that_do_not():
    random = np.random.default_rng(6)
    late = np.cumsum(1.0 + random.normal(0, 0.02, 5000))
    kept = np.arange(5000) + random.normal(0, 0.02, 5000)
    name = "correlation of successive intervals"
    assert noise.clock(late)[name][0] == pytest.approx(0, abs=0.05)
    assert noise.clock(kept)[name][0] == pytest.approx(-0.5, abs=0.05)
    assert noise.clock(kept)["scatter of the interval"][0] == pytest.approx(20 * 2**0.5, rel=0.05)


@pytest.mark.parametrize(("beta", "tau"), [(1.0, 50.0), (0.5, 100.0), (0.4, 20.0)])
def test_stretched_exponent_is_found(beta, tau):
    second = np.geomspace(1.0, 3600.0, 400)
    volt = 3.6 - 0.05 * np.exp(-((second / tau) ** beta))
    found = responses.stretched(second, volt)
    assert found[0] == pytest.approx(beta, abs=0.01)
    assert found[1] == pytest.approx(tau, rel=0.02)
    assert found[2] < 1e-3


def test_rest_after_a_load_is_measured_from_the_last_loaded_sample(tmp_path):
    source = campaign(tmp_path, {"step": ("relaxation", loaded_then_rest())})
    (record,) = load(source)
    (rest,) = responses.rests(record)
    _, condition, second, volt = rest
    assert condition == "after a discharge step"
    share = responses.shares(second, volt, until_second=600.0)
    for time in (1.0, 10.0, 100.0):
        way = 0.02 + 0.03 * (1 - np.exp(-time / 60))
        assert share[time] == pytest.approx(way / 0.05, abs=0.003)


def test_response_to_a_step_of_current_is_that_of_the_circuit(tmp_path):
    source = campaign(tmp_path, {"step": ("relaxation", loaded_then_rest())})
    (record,) = load(source)
    (step,) = responses.pulse_steps(record)
    second, ohm = responses.pulse_response(record, step)
    wanted = 0.02 + 0.03 * (1 - np.exp(-(second + 0.5) / 60))
    np.testing.assert_allclose(ohm, wanted, atol=2e-5)


def test_peaks_of_a_known_curve_are_found():
    """Charge in two logistic steps: dQ/dV has peaks there, 3.53 widths wide at half height."""
    centres, scale = np.array([3.60, 3.95]), np.array([0.02, 0.03])
    volt = np.linspace(3.2, 4.2, 4000)
    charge = sum(1 / (1 + np.exp(-(volt - c) / s)) for c, s in zip(centres, scale, strict=True))
    noisy = volt + np.random.default_rng(7).normal(0, 0.0003, volt.size)
    found = responses.found_peaks(*responses.incremental_capacity(noisy, charge, smooth_volt=0.005))
    assert [place for place, _, _ in found] == pytest.approx(centres, abs=0.004)
    assert [width for _, _, width in found] == pytest.approx(3.53 * scale, rel=0.1)
    assert [height for _, height, _ in found] == pytest.approx(1 / (4 * scale), rel=0.06)


def test_incremental_capacity_gives_the_charge_back():
    volt, charge = np.linspace(3.0, 4.2, 500), np.linspace(0, 5.0, 500)
    middle, per_volt = responses.incremental_capacity(volt, charge, smooth_volt=0.005)
    assert per_volt.sum() * (middle[1] - middle[0]) == pytest.approx(5.0, rel=1e-6)
    assert np.median(per_volt) == pytest.approx(5.0 / 1.2, rel=1e-3)


@pytest.mark.parametrize(
    ("value", "said"),
    [(1.05, "within"), (3.0, "above, 3 times"), (0.1, "below, 5 times"), (-1, "below, 1.5 off")],
)
def test_verdict_says_where_and_by_how_much(value, said):
    assert check.verdict(value, [0.5, 1.0]) == said


def test_a_laboratory_is_judged_by_real_sources_only():
    def number(source, real, value):
        about = ("c", "t", 0, "noise", "at rest", "white noise of voltage", value, "mV")
        return Number(source, real, *about)

    found = [number("lab", False, 0.9), number("other lab", False, 9.0), number("r", True, 0.3)]
    (row,) = check.comparison_rows(found)
    assert row.verdicts == {"lab": "above, 3 times", "other lab": "above, 30 times"}


def test_what_is_absent_or_unreadable_is_skipped_with_a_reason(tmp_path):
    (nowhere,) = load(Source("nowhere", tmp_path / "nowhere", True))
    assert isinstance(nowhere, Skipped)
    assert "missing" in nowhere.reason
    source = campaign(tmp_path / "x", {"bad": ("capacity", loaded_then_rest())})
    (source.folder / "bad.csv").write_text("not a record\n")
    (bad,) = load(source)
    assert isinstance(bad, Skipped)
    assert bad.test == "X/bad"


def test_campaigns_are_named():
    assert named("demo=somewhere", real=False) == Source("demo", Path("somewhere"), False)
    assert named("real/a123", real=True).name == "a123"


def test_workbook_becomes_the_text_of_its_channel():
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    other = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    texts = "<si><t>Time</t></si><si><t>Volt</t></si>"
    rows = (
        '<sheetData><row r="1"><c r="A1" t="s"><v>0</v></c><c r="C1" t="s"><v>1</v></c></row>'
        '<row r="2"><c r="A2"><v>0.5</v></c><c r="C2"><v>-1.25E-2</v></c></row></sheetData>'
    )
    parts = {
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{other}"><sheets>'
        '<sheet name="Info" r:id="r1"/><sheet name="Channel_1-002" r:id="r2"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": '<Relationships><Relationship Id="r1" Target="a.xml"/>'
        '<Relationship Id="r2" Target="worksheets/two.xml"/></Relationships>',
        "xl/sharedStrings.xml": f'<sst xmlns="{main}">{texts}</sst>',
        "xl/worksheets/two.xml": f'<worksheet xmlns="{main}">{rows}</worksheet>',
    }
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as book:
        for name, text in parts.items():
            book.writestr(name, text)
    assert records.channel_csv(content.getvalue()) == b"Time,,Volt\n0.5,,-1.25E-2\n"


def test_all_of_it_is_written(tmp_path):
    tests = {"step": ("relaxation", loaded_then_rest(SIGMA))}
    sources = [campaign(tmp_path / "lab", tests), Source("gone", tmp_path / "gone", True)]
    found = check.look(sources)
    check.write(found, sources, tmp_path / "out")
    with (tmp_path / "out" / "reality.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    white = [float(r["value"]) for r in rows if r["quantity"] == "white noise of voltage"]
    assert white == pytest.approx([1e3 * SIGMA] * len(white), rel=0.15)
    assert len(white) >= 2
    page = (tmp_path / "out" / "reality.md").read_text()
    assert "gone" in page.split("## Not looked at")[1]
    assert {path.name for path in (tmp_path / "out").glob("*.png")} == {
        f"{name}.png" for name in ("noise", "relaxation", "pulse")
    }
    assert "peaks.png" not in page


def test_the_demo_can_be_looked_at():
    """The demo's own settings come back: 0.3 mV steps, 0.3 mV noise and rounding, late clock."""
    root = Path(__file__).resolve().parents[2]
    records = load(Source("demo", root, False), most_cells=1)
    record = next(r for r in records if isinstance(r, Record) and r.test == "capacity_25C")
    found = {(n.condition, n.quantity): n.value for n in noise.look_at_noise(record)[0]}
    assert found["whole record", "step of voltage"] == pytest.approx(0.3, rel=1e-3)
    wanted = np.hypot(0.3, 0.3 / 12**0.5)
    assert found["at rest", "white noise of voltage"] == pytest.approx(wanted, rel=0.25)
    assert found["at rest", "scatter of the interval"] == pytest.approx(70 / 12**0.5, rel=0.25)


def test_a_time_far_from_any_sample_is_left_out():
    second = np.array([0.0, 0.04, 5.0, 35.0, 65.0, 95.0, 110.0, 700.0])
    found = responses.shares(second, np.linspace(3.5, 3.6, 8), until_second=600.0)
    assert list(found) == [100.0]
