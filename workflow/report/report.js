(function () {
  // It stands behind the overview, which can be used while the pages below are still being read.
  var body = document.body, waiting = false;
  body.classList.add("js");
  // In a large report a page lies in its section as gzip in base64, unpacked when looked at first.
  function unpack(section) {
    var packed = section.querySelector("script[type='application/gzip']");
    if (!packed) { return Promise.resolve(); }
    if (!window.DecompressionStream) {
      section.textContent = "This browser, older than 2023, cannot unpack this page: open the figures in the folder figures and the tables in tables beside this file, or this file in a newer browser.";
      return Promise.resolve();
    }
    var bytes = Uint8Array.from(atob(packed.textContent), function (c) { return c.charCodeAt(0); });
    packed.remove();
    var plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(plain).text().then(function (html) { section.innerHTML = html; ready(section); });
  }
  // What helps with a script: a button that unfolds, tables that scroll by keyboard where they must.
  function ready(part) {
    part.querySelectorAll(".fold, .closer, .saves").forEach(function (button) { button.hidden = false; });
    part.querySelectorAll(".scroll").forEach(function (box) { box.tabIndex = box.scrollWidth > box.clientWidth ? 0 : -1; });
  }
  // `#cell-C3/tests` is a place on the page `cell-C3`. Back returns to where one was.
  function show(top) {
    var id = "overview";
    try { id = decodeURIComponent(location.hash.slice(1)) || id; } catch (error) { id = "overview"; }
    var page = id.split("/")[0], all = page === "all", sections = Array.from(document.querySelectorAll("main > section"));
    waiting = document.readyState === "loading" && (all || !sections.some(function (s) { return s.id === page; }));
    if (waiting) { return; }
    if (!all && !sections.some(function (s) { return s.id === page; })) { page = "overview"; }
    var shown = sections.filter(function (s) { return all || s.id === page; });
    sections.forEach(function (s) { s.classList.toggle("here", shown.includes(s)); });
    document.querySelectorAll(".pages a").forEach(function (a) { a.classList.toggle("here", a.getAttribute("href") === "#" + page); });
    Promise.all(shown.map(unpack)).then(function () {
      var spot = id === page ? null : document.getElementById(id);
      for (var up = spot; up; up = up.parentElement) { if (up.tagName === "DETAILS") { up.open = true; } }
      if (typeof top === "number") { window.scrollTo(0, top); } else if (spot) { spot.scrollIntoView(); } else { window.scrollTo(0, 0); }
      body.dataset.shown = id === page || spot ? id : page;
      // Paper does not wait for pictures that nobody has scrolled to.
      setTimeout(function () { shown.forEach(function (s) { s.querySelectorAll("img").forEach(function (img) { img.loading = "eager"; }); }); }, 300);
    });
  }
  var later;
  function remember() { clearTimeout(later); history.replaceState({ top: window.scrollY }, ""); }
  history.scrollRestoration = "manual";
  window.addEventListener("scroll", function () { clearTimeout(later); later = setTimeout(remember, 150); });
  document.addEventListener("click", function (event) {
    if (event.target.closest("a[href]")) { remember(); }
    // A click marks the whole command; where the browser allows it, it is copied too.
    var command = event.target.closest(".again code");
    if (command && navigator.clipboard) { navigator.clipboard.writeText(command.textContent).then(function () { command.dataset.copied = ""; }, function () {}); }
    var fold = event.target.closest(".fold");
    if (fold) {
      var chapters = Array.from(fold.closest("section").querySelectorAll("details.chapter"));
      var open = chapters.some(function (one) { return !one.open; });
      chapters.forEach(function (one) { one.open = open; });
      fold.textContent = open ? "Fold all" : "Unfold all";
    }
  }, true);
  window.addEventListener("popstate", function (event) { show(event.state && event.state.top); });
  // On paper a cell whose chapters are all folded is two pages; one chapter unfolded, and it is whole.
  var unfolded = [];
  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("section.here").forEach(function (section) {
      var chapters = section.id.startsWith("cell-") && section.querySelector("details.chapter");
      section.classList.toggle("brief", Boolean(chapters) && !section.querySelector("details.chapter[open]"));
    });
    unfolded = Array.from(document.querySelectorAll("section.here details:not([open]):not(td *)"));
    unfolded.forEach(function (one) { one.open = true; });
  });
  window.addEventListener("afterprint", function () { unfolded.forEach(function (one) { one.open = false; }); });
  // Units and columns of the overview: the numbers before the first word, and a range in brackets.
  var UNITS = { Ah: { mAh: 3 }, "mΩ": { "Ω": -3 }, mV: { V: -3 } };
  function moved(text, digits) {
    return text.replace(/^[-\d.]+(?: ± [\d.]+)?|\([\d.]+–[\d.]+\)/g, function (part) {
      return part.replace(/\d+(?:\.\d+)?/g, function (one) {
        var places = Math.max((one.split(".")[1] || "").length - digits, 0);
        return (Number(one) * Math.pow(10, digits)).toFixed(places);
      });
    });
  }
  function choices(box, headings, rows) {
    headings.forEach(function (th, k) {
      if (!k) { return; }
      var name = th.textContent, unit = (/\[(.+)\]/.exec(name) || [])[1], label = document.createElement("label"), tick = document.createElement("input");
      var cells = rows.map(function (row) { return row.cells[k]; }), texts = cells.map(function (cell) { return cell.textContent; });
      tick.type = "checkbox";
      tick.checked = true;
      tick.addEventListener("change", function () { cells.concat(th).forEach(function (cell) { cell.hidden = !tick.checked; }); });
      label.append(tick, name);
      box.append(label);
      if (!UNITS[unit]) { return; }
      var select = document.createElement("select");
      select.setAttribute("aria-label", "Unit of " + name);
      [unit].concat(Object.keys(UNITS[unit])).forEach(function (one) { select.append(new Option(one)); });
      select.addEventListener("change", function () {
        var digits = UNITS[unit][select.value] || 0, heading = name.replace(unit, select.value);
        cells.forEach(function (cell, n) { cell.textContent = digits ? moved(texts[n], digits) : texts[n]; cell.dataset.label = heading; });
        (th.querySelector("button") || th).textContent = heading;
      });
      label.append(" ", select);
    });
  }
  // Cells of the overview: sorted by a click on a heading, filtered by type, text and mark.
  var table = document.querySelector("table.cells");
  if (table) {
    var rows = Array.from(table.tBodies[0].rows), headings = Array.from(table.tHead.rows[0].cells);
    var texts = rows.map(function (row) { return row.textContent.toLowerCase(); });
    var columns = document.querySelector(".columns");
    if (columns) { choices(columns, headings, rows); columns.parentElement.hidden = false; }
    var key = function (row, k) { var cell = row.cells[k]; return cell.dataset.key || (cell.textContent.trim() ? cell.textContent : ""); };
    headings.forEach(function (th, k) {
      var button = document.createElement("button");
      button.type = "button";
      button.textContent = th.textContent;
      th.textContent = "";
      th.append(button);
      button.addEventListener("click", function () {
        var way = th.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        headings.forEach(function (other) { other.removeAttribute("aria-sort"); });
        th.setAttribute("aria-sort", way > 0 ? "ascending" : "descending");
        // What is not known stands last, either way.
        table.tBodies[0].append.apply(table.tBodies[0], rows.slice().sort(function (a, b) {
          var x = key(a, k), y = key(b, k);
          if (!x || !y) { return x ? -1 : y ? 1 : 0; }
          return way * (isNaN(x) || isNaN(y) ? x.localeCompare(y, undefined, { numeric: true }) : x - y);
        }));
      });
    });
  }
  var form = document.querySelector(".filter");
  if (form) {
    var word = form.querySelector("input[type=search]");
    var type = form.querySelector("select"), look = form.querySelector("input[type=checkbox]"), count = form.querySelector("output");
    var filter = function () {
      var wanted = word.value.toLowerCase().trim(), left = 0;
      rows.forEach(function (row, k) {
        var fits = texts[k].includes(wanted) && (!type.value || row.dataset.type === type.value) && (!look.checked || "look" in row.dataset);
        row.hidden = !fits;
        left += fits;
      });
      count.textContent = left + " of " + rows.length + " cells";
    };
    form.addEventListener("input", filter);
    form.hidden = false;
    filter();
  }
  var top = history.state && history.state.top;
  document.addEventListener("DOMContentLoaded", function () {
    document.querySelectorAll("[data-written]").forEach(function (spot) { spot.textContent = spot.dataset.written + new Date(document.lastModified).toLocaleString(undefined, { dateStyle: "long", timeStyle: "short" }); });
    ready(document);
    if (waiting) { show(top); }
  });
  show(top);
})();
