// A closer look at a predicted test: the lines that stand beside its figure, drawn by uPlot on one
// time axis. Drag to zoom, shift and drag to pan, double click for all; arrows, + and − do the same.
(function () {
  var colours = ["#1f6fb4", "#d1661c", "#2a9d5c", "#7a4fa3"], built = 0;
  function unpacked(text) {
    var bytes = Uint8Array.from(atob(text), function (c) { return c.charCodeAt(0); });
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
  }
  function panelsOf(lines) {
    var panels = [];
    lines.slice(1).forEach(function (line) {
      var last = panels[panels.length - 1];
      if (!last || last.title !== line.panel) { panels.push(last = { title: line.panel, lines: [] }); }
      last.lines.push(line);
    });
    return panels;
  }
  function draw(box, lines) {
    var time = lines[0].values, plots = [], key = "closer-" + (built += 1), said = document.createElement("output");
    var ink = getComputedStyle(document.body).getPropertyValue("--ink"), line = getComputedStyle(document.body).getPropertyValue("--line");
    said.setAttribute("aria-live", "polite");
    var range = function (min, max) {
      var first = time[0], last = time[time.length - 1], width = Math.min(max - min, last - first);
      min = Math.max(first, Math.min(min, last - width));
      plots.forEach(function (plot) { plot.setScale("x", { min: min, max: min + width }); });
    };
    var moved = function (share) { var x = plots[0].scales.x, by = share * (x.max - x.min); range(x.min + by, x.max + by); };
    var zoomed = function (factor) {
      var x = plots[0].scales.x, at = time[plots[0].cursor.idx], middle = at >= x.min && at <= x.max ? at : (x.min + x.max) / 2;
      range(middle - (middle - x.min) * factor, middle + (x.max - middle) * factor);
    };
    var busy = false;
    panelsOf(lines).forEach(function (panel, k, all) {
      var last = k === all.length - 1, axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line } };
      plots.push(new uPlot({
        width: Math.max(box.clientWidth, 280), height: k ? 170 : 220, scales: { x: { time: false } },
        cursor: { sync: { key: key }, drag: { x: true, y: false }, bind: { mousedown: function (plot, target, handler) {
          return function (event) {
            if (!event.shiftKey) { return handler(event); }
            var from = event.clientX, x = plot.scales.x, scale = (x.max - x.min) / plot.over.clientWidth, min = x.min, max = x.max;
            var pan = function (e) { range(min - (e.clientX - from) * scale, max - (e.clientX - from) * scale); };
            var end = function () { removeEventListener("mousemove", pan); removeEventListener("mouseup", end); };
            addEventListener("mousemove", pan); addEventListener("mouseup", end);
          };
        } } },
        axes: [Object.assign({ label: last ? "time [h]" : "", size: last ? 42 : 24 }, axis), Object.assign({ label: panel.title, size: 62 }, axis)],
        series: [{ label: "time [h]" }].concat(panel.lines.map(function (one, n) { return { label: one.label, stroke: colours[n], width: 1.2 }; })),
        hooks: { setScale: [function (plot, scale) {
          if (scale !== "x" || busy) { return; }
          busy = true;
          plots.forEach(function (other) { if (other !== plot) { other.setScale("x", { min: plot.scales.x.min, max: plot.scales.x.max }); } });
          busy = false;
        }] }
      }, [time].concat(panel.lines.map(function (one) { return one.values; })), box));
    });
    box.append(said);
    box.addEventListener("keydown", function (event) {
      var step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], zoom = { "+": 0.5, "=": 0.5, "-": 2 }[event.key];
      if (step && event.shiftKey) { moved(step / 4); }
      else if (step) { tell(step); }
      else if (zoom) { zoomed(zoom); }
      else if (event.key === "0" || event.key === "Home") { range(time[0], time[time.length - 1]); }
      else { return; }
      event.preventDefault();
    });
    var spot = 0;
    function tell(step) {
      spot = Math.max(0, Math.min(time.length - 1, spot + step * Math.max(1, Math.round(time.length / 200))));
      plots.forEach(function (plot) { plot.setCursor({ left: plot.valToPos(time[spot], "x"), top: 10 }); });
      said.textContent = lines.map(function (one) { return one.label + " " + one.values[spot]; }).join(", ");
    }
    addEventListener("resize", function () { plots.forEach(function (plot) { plot.setSize({ width: Math.max(box.clientWidth, 280), height: plot.height }); }); });
  }
  document.addEventListener("click", function (event) {
    var button = event.target.closest(".closer");
    if (!button) { return; }
    var figure = button.closest("figure"), data = figure.querySelector("script.lines"), box = figure.querySelector(".look");
    if (box) { box.hidden = !box.hidden; button.setAttribute("aria-expanded", String(!box.hidden)); return; }
    box = document.createElement("div");
    box.className = "look"; box.tabIndex = 0;
    box.setAttribute("role", "application");
    box.setAttribute("aria-label", "Lines of this test. Left and right read values, plus and minus zoom, shift and arrows pan, 0 shows all.");
    figure.append(box);
    button.setAttribute("aria-expanded", "true");
    unpacked(data.textContent).then(function (lines) { draw(box, lines); box.focus(); });
  });
})();
