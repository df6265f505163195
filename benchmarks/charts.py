"""Libraries for figures to zoom into, side by side in a headless Chromium: bytes, time, heap.

    cd FOLDER && npm pack uplot plotly.js-dist-min echarts vega
    for one in *.tgz; do mkdir ${one%.tgz} && tar xzf $one -C ${one%.tgz}; done
    ./run python benchmarks/charts.py FOLDER results C1 us06_25C

One page each with 20,000 points of a predicted test in four panels on one time axis, and the
library within it, as in the report. Times are CPU of the page's thread, which another load of the
machine does not change: until the first picture, and of a zoom to half the record.
"""

import gzip
import json
import re
import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np

from runtime import artefact, closer_look
from tools import browser

POINTS, ZOOMS, LOADS = 20_000, 5, 5
# Of each: its files within the folder, what draws `panels` into #chart, and what zooms to [a, b].
UPLOT = """var plots = panels.map(p => new uPlot({width: 1000, height: 180,
  scales: {x: {time: false}}, cursor: {sync: {key: "k"}}, series: [{}].concat(
  p.lines.map(l => ({label: l.label, stroke: "#1f6fb4"})))},
  [time].concat(p.lines.map(l => l.values)), chart));
var zoom = (a, b) => plots.forEach(p => p.setScale("x", {min: a, max: b}));"""
PLOTLY = """var traces = panels.flatMap((p, k) => p.lines.map(l => ({x: time, y: l.values,
  name: l.label, mode: "lines", line: {width: 1}, xaxis: "x", yaxis: "y" + (k ? k + 1 : "")})));
var ready = Plotly.newPlot(chart, traces, {width: 1000, height: 720,
  grid: {rows: 4, columns: 1, subplots: [["xy"], ["xy2"], ["xy3"], ["xy4"]]}});
var zoom = (a, b) => Plotly.relayout(chart, {"xaxis.range": [a, b]});"""
ECHARTS = """chart.style.cssText = "width: 1000px; height: 720px";
var one = echarts.init(chart), all = [0, 1, 2, 3]; one.setOption({animation: false,
  grid: all.map(k => ({top: 20 + 175 * k, height: 140, left: 60, right: 20})),
  xAxis: all.map(k => ({gridIndex: k, type: "value", min: "dataMin", max: "dataMax"})),
  yAxis: all.map(k => ({gridIndex: k, scale: true})), tooltip: {trigger: "axis"},
  axisPointer: {link: [{xAxisIndex: "all"}]},
  dataZoom: [{type: "inside", xAxisIndex: all, filterMode: "none"}],
  series: panels.flatMap((p, k) => p.lines.map(l => ({type: "line", name: l.label,
    showSymbol: false, lineStyle: {width: 1}, xAxisIndex: k, yAxisIndex: k,
    data: time.map((t, n) => [t, l.values[n]])})))});
var zoom = (a, b) => one.dispatchAction({type: "dataZoom", startValue: a, endValue: b});"""
VEGA = """var axes = [{orient: "bottom", scale: "x"}, {orient: "left", scale: "y"}];
var view = new vega.View(vega.parse({width: 940, height: 700, padding: 30,
  signals: [{name: "domain", value: [time[0], time[time.length - 1]]}],
  data: panels.map((p, k) => ({name: "d" + k, values: time.flatMap((t, n) => p.lines.map(
    l => ({t: t, v: l.values[n], l: l.label})))})),
  scales: [{name: "x", type: "linear", domain: {signal: "domain"}, range: [0, 940], zero: false}],
  marks: panels.map((p, k) => ({type: "group", clip: true, encode: {enter: {y: {value: 175 * k},
    width: {value: 940}, height: {value: 140}}}, axes: axes,
    scales: [{name: "y", domain: {data: "d" + k, field: "v"}, range: [140, 0], zero: false}],
    marks: [{type: "group", from: {facet: {name: "f" + k, data: "d" + k, groupby: "l"}},
      marks: [{type: "line", from: {data: "f" + k}, encode: {update: {stroke: {value: "#1f6fb4"},
        x: {scale: "x", field: "t"}, y: {scale: "y", field: "v"}}}}]}]}))}),
  {renderer: "canvas", container: chart});
var ready = view.runAsync(); var zoom = (a, b) => view.signal("domain", [a, b]).runAsync();"""
LIBRARIES = {
    "uPlot": ("uplot-*/package/dist/uPlot.iife.min.js", UPLOT),
    "ECharts": ("echarts-*/package/dist/echarts.min.js", ECHARTS),
    "Vega": ("vega-*/package/build/vega.min.js", VEGA),
    "plotly": ("plotly.js-dist-min-*/package/plotly.min.js", PLOTLY),
}
PAGE = """<!doctype html><meta charset="utf-8"><div id="chart"></div><script>{library}</script>
<script>var lines = {lines}, time = lines[0].values, panels = [], chart =
document.getElementById("chart");
lines.slice(1).forEach(l => {{ var last = panels[panels.length - 1];
  if (!last || last.title !== l.panel) panels.push(last = {{title: l.panel, lines: []}});
  last.lines.push(l); }});
var painted = () => new Promise(done => requestAnimationFrame(() => setTimeout(done, 0)));
{draw}
Promise.resolve(window.ready).then(painted).then(() => {{ window.first = performance.now(); }});
async function zoomed(a, b) {{ await zoom(a, b); await painted(); }}</script>"""


def lines_of(results, cell, test) -> str:
    """The closer look of a predicted test at evenly spaced times, as JSON."""
    stages = Path(results, "stages")
    (path,) = stages.glob(f"simulation/{cell}/{test}.parquet")
    columns = artefact.load(path)
    model = next(name for name in columns if name.startswith("simulated_"))
    clean = artefact.load(stages / "clean" / cell / f"{test}.parquet")
    celsius = np.interp(
        columns["test_time_second"], clean["test_time_second"], clean["surface_temperature_celsius"]
    )
    chosen = model.removeprefix("simulated_").removesuffix("_volt")
    lines = closer_look.lines_of(columns, chosen, celsius)
    hours = lines[0].values
    even = np.linspace(hours[0], hours[-1], POINTS)
    shown = [{"panel": "", "label": "time", "values": np.round(even, 6).tolist()}]
    for line in lines[1:]:
        values = np.round(np.interp(even, hours, line.values), 5).tolist()
        shown.append({"panel": line.panel, "label": line.label, "values": values})
    return json.dumps(shown)


def cpu_millisecond(tab) -> float:
    """CPU time of the page's thread since it was opened."""
    metrics = tab.call("Performance.getMetrics")["metrics"]
    return next(1e3 * one["value"] for one in metrics if one["name"] == "TaskDuration")


def measured(tab, page) -> tuple:
    """CPU to the first picture [ms] and of a zoom [ms], heap [MB] of a page, medians."""
    firsts, zooms, heaps = [], [], []
    for _ in range(LOADS):
        tab.call("Page.navigate", url="about:blank")
        before = cpu_millisecond(tab)
        tab.go(page, shown=False)
        tab.wait("window.first")
        after = cpu_millisecond(tab)
        firsts.append(after - (before if before < after else 0.0))
        for k in range(ZOOMS):
            begin, share = cpu_millisecond(tab), f"time[{POINTS // 10 * k}]"
            tab.evaluate(f"zoomed({share}, {share} + time[{POINTS - 1}] / 2)")
            zooms.append(cpu_millisecond(tab) - begin)
        tab.call("HeapProfiler.collectGarbage")
        heaps.append(tab.call("Runtime.getHeapUsage")["usedSize"] / 1e6)
    return tuple(statistics.median(values) for values in (firsts, zooms, heaps))


def main(folder, results, cell, test):
    """Print a row for each library."""
    lines = lines_of(results, cell, test)
    print(
        "| library | kB, gzip | first picture [ms] | zoom [ms] | heap [MB] |\n" + "|---" * 5 + "|"
    )
    with tempfile.TemporaryDirectory() as pages, browser.opened() as tab:
        tab.size(1280)
        tab.call("Performance.enable", timeDomain="threadTicks")
        for name, (pattern, draw) in LIBRARIES.items():
            (path,) = Path(folder).glob(pattern)
            library = path.read_text(encoding="utf-8").replace("</script", "<\\/script")
            page = Path(pages, f"{name}.html")
            page.write_text(PAGE.format(library=library, lines=lines, draw=draw), encoding="utf-8")
            first, zoom, heap = measured(tab, page)
            packed = len(gzip.compress(library.encode())) / 1e3
            version = re.search(r"-(\d[\d.]*)$", path.relative_to(folder).parts[0])[1]
            row = [f"{name} {version}", f"{len(library.encode()) / 1e3:.0f}, {packed:.0f}"]
            print(f"| {' | '.join([*row, f'{first:.0f}', f'{zoom:.0f}', f'{heap:.0f}'])} |")
            if tab.console:
                sys.exit("\n".join(tab.console))


if __name__ == "__main__":
    main(*sys.argv[1:])
