// Every figure as PNG, and its numbers as CSV: read back from its drawing, whose panels say their
// scales, so that they cost the file nothing. Their resolution is that of the drawing.
(function () {
  function save(name, blob) {
    var a = document.createElement("a");
    a.href = URL.createObjectURL(blob);
    a.download = name;
    a.click();
    setTimeout(function () { URL.revokeObjectURL(a.href); }, 1000);
  }
  function quoted(one) { return /[",\n]/.test(one) ? '"' + one.replace(/"/g, '""') + '"' : one; }
  window.saveAs = save;
  window.quoted = quoted;
  // Points of a path: M and L are places, l steps, of curves the ends.
  function pointsOf(d) {
    var points = [], mode = "M", x = 0, y = 0, numbers = [];
    (d.match(/[a-zA-Z]|-?(?:\d+\.?\d*|\.\d+)/g) || []).forEach(function (token) {
      if (/[a-zA-Z]/.test(token)) { mode = token; numbers = []; return; }
      numbers.push(Number(token));
      var need = { C: 6, Q: 4, h: 1 }[mode] || 2;
      if (numbers.length < need || mode === "h") { return; }
      var to = numbers.slice(-2);
      x = mode === "l" ? x + to[0] : to[0];
      y = mode === "l" ? y + to[1] : to[1];
      points.push([x, y]);
      numbers = [];
    });
    return points;
  }
  function valueAt(scale, place) {
    var at = scale.at, k = 1, up = at[at.length - 1][1] > at[0][1];
    while (k < at.length - 1 && (up ? place > at[k][1] : place < at[k][1])) { k += 1; }
    var from = at[k - 1], to = at[k], share = (place - from[1]) / (to[1] - from[1]);
    var of = scale.log ? Math.log : Number, back = scale.log ? Math.exp : Number;
    return Number(back(of(from[0]) + share * (of(to[0]) - of(from[0]))).toPrecision(5));
  }
  function nameOf(part, attribute, otherwise) { var name = part.getAttribute(attribute); return name === "_" ? otherwise : name; }
  function numbersOf(svg) {
    var rows = [["panel", "series", "x", "y", "x is", "y is"]];
    svg.querySelectorAll("[data-panel]").forEach(function (panel, n) {
      var x = JSON.parse(panel.getAttribute("data-x-scale")), y = JSON.parse(panel.getAttribute("data-y-scale"));
      var title = nameOf(panel, "data-panel", "panel " + (n + 1));
      panel.querySelectorAll("[data-s]").forEach(function (group, k) {
        var points = [];
        group.querySelectorAll("path, use").forEach(function (one) {
          if (one.closest("defs")) { return; }
          if (one.tagName === "path") { points = points.concat(pointsOf(one.getAttribute("d"))); }
          else { points.push([Number(one.getAttribute("x")), Number(one.getAttribute("y"))]); }
        });
        points.forEach(function (point) {
          rows.push([title, nameOf(group, "data-s", "series " + (k + 1)), valueAt(x, point[0]), valueAt(y, point[1]), x.label, y.label]);
        });
      });
    });
    return rows.map(function (row) { return row.map(String).map(quoted).join(","); }).join("\n") + "\n";
  }
  document.addEventListener("click", function (event) {
    var button = event.target.closest(".save");
    if (!button) { return; }
    var figure = button.closest("figure"), img = figure.querySelector("img");
    var name = figure.id.replace(/^cell-/, "").replace(/[^\w.-]+/g, "_");
    if (button.dataset.as === "csv") {
      var text = decodeURIComponent(img.getAttribute("src").slice("data:image/svg+xml,".length)).replace(/<style[^]*?<\/style>/g, "");
      save(name + ".csv", new Blob([numbersOf(new DOMParser().parseFromString(text, "image/svg+xml"))], { type: "text/csv" }));
      return;
    }
    var canvas = document.createElement("canvas"), scale = 3;
    img.decode().then(function () {
      canvas.width = scale * img.getAttribute("width");
      canvas.height = scale * img.getAttribute("height");
      var pen = canvas.getContext("2d");
      pen.fillStyle = "#ffffff";
      pen.fillRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(img, 0, 0, canvas.width, canvas.height);
      canvas.toBlob(function (blob) { save(name + ".png", blob); });
    });
  });
})();
