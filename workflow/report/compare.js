// The page Compare: curves of cells and tests that the reader chooses, laid over each other by uPlot.
(function () {
  var section = document.getElementById("compare"), plot = null, drawn = [], quantities = null, started = false;
  var colours = ["#1f6fb4", "#d1661c", "#2a9d5c", "#7a4fa3", "#c0392b", "#7f6a00", "#00838f", "#ad1457"];
  function start() {
    if (!section || started || !/^#(compare|all)/.test(location.hash)) { return; }
    started = true;
    var packed = section.querySelector("script.curves").textContent;
    var bytes = Uint8Array.from(atob(packed), function (c) { return c.charCodeAt(0); });
    new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json().then(function (found) {
      quantities = found;
      section.querySelector("form").hidden = false;
      list();
    });
  }
  function quantity() { var id = section.querySelector("select").value; return quantities.find(function (one) { return one.id === id; }); }
  // Boxes of the curves, grouped by cell; of each cell the first is chosen, up to as many as colours.
  function list() {
    var box = section.querySelector(".choice"), seen = {};
    box.textContent = "";
    quantity().curves.forEach(function (one, k) {
      var label = document.createElement("label"), tick = document.createElement("input");
      tick.type = "checkbox";
      tick.value = k;
      tick.checked = !seen[one.cell] && Object.keys(seen).length < colours.length;
      seen[one.cell] = true;
      label.append(tick, one.cell + " " + one.label);
      box.append(label);
    });
    draw();
  }
  function draw() {
    var about = quantity(), box = section.querySelector(".plot"), style = getComputedStyle(document.body);
    var ticks = Array.from(section.querySelectorAll(".choice input:checked"));
    drawn = ticks.map(function (tick) { return about.curves[tick.value]; });
    if (plot) { plot.destroy(); plot = null; }
    section.querySelector("output").textContent = drawn.length + " of " + about.curves.length + " curves";
    if (!drawn.length) { return; }
    var axis = { stroke: style.getPropertyValue("--ink"), grid: { stroke: style.getPropertyValue("--line"), width: 1 } };
    plot = new uPlot({
      width: Math.max(box.clientWidth, 280), height: 420, scales: { x: { time: false, range: wide }, y: { range: wide } },
      axes: [Object.assign({ label: about.x }, axis), Object.assign({ label: about.y, size: 66 }, axis)],
      series: [{ label: about.x }].concat(drawn.map(function (one, k) {
        return { label: one.cell + " " + one.label, stroke: colours[k % colours.length], dash: k < colours.length ? [] : [6, 3], width: 1.4, spanGaps: true, points: { show: one.x.length < 30, size: 6 } };
      }))
    }, uPlot.join(drawn.map(function (one) { return [one.x, one.y]; })), box);
  }
  // Points that are one get an axis of a hundredth of their size, on which labels differ.
  function wide(of, low, high) {
    if (low === null) { return [low, high]; }
    var least = Math.max(Math.abs(low), Math.abs(high), 1e-9) / 100, more = Math.max(0.04 * (high - low), (least - high + low) / 2);
    return [low - more, high + more];
  }
  if (section) {
    section.addEventListener("change", function (event) { if (event.target.matches("select")) { list(); } else { draw(); } });
    section.addEventListener("input", function (event) {
      if (!event.target.matches("[type=search]")) { return; }
      var wanted = event.target.value.toLowerCase().trim();
      section.querySelectorAll(".choice label").forEach(function (one) { one.hidden = !one.textContent.toLowerCase().includes(wanted); });
    });
    section.addEventListener("click", function (event) {
      var button = event.target.closest("button[data-do]");
      if (!button) { return; }
      if (button.dataset.do === "none" || button.dataset.do === "all") {
        section.querySelectorAll(".choice label:not([hidden]) input").forEach(function (one) { one.checked = button.dataset.do === "all"; });
        draw();
      } else if (plot && button.dataset.do === "png") {
        plot.ctx.canvas.toBlob(function (blob) { window.saveAs("compare.png", blob); });
      } else if (plot) {
        var about = quantity(), rows = [["cell", "curve", about.x, about.y].map(window.quoted).join(",")];
        drawn.forEach(function (one) { one.x.forEach(function (x, k) { rows.push([one.cell, one.label, String(x), String(one.y[k])].map(window.quoted).join(",")); }); });
        window.saveAs("compare.csv", new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
      }
    });
    window.addEventListener("hashchange", start);
    window.addEventListener("resize", function () { if (plot) { plot.setSize({ width: Math.max(section.querySelector(".plot").clientWidth, 280), height: 420 }); } });
    start();
  }
})();
