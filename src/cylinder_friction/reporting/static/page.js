'use strict';
// Figures are drawn when they come into sight, so that a long page opens at once.
const NARROW = 520, LONGEST = 20, PAPER = 690;

// Panels side by side are too narrow on a small screen: there, they stand one below the other.
function stack(layout) {
  const axes = Object.keys(layout).filter(key => key.startsWith('xaxis')).sort(
    (one, other) => layout[one].domain[0] - layout[other].domain[0]);
  const count = axes.length;
  if (count < 2 || new Set(axes.map(key => layout[key].domain[0])).size < count) return 1;
  axes.forEach(function (key, index) {
    const pitch = 1 / (count - 0.28), top = 1 - index * pitch;
    layout[key].domain = [0, 1];
    layout['y' + key.slice(1)].domain = [Math.max(0, top - 0.72 * pitch), top];
    const note = (layout.annotations || [])[index];
    if (note) Object.assign(note, {x: 0.5, y: top});
  });
  return 0.8 * count;
}

// Numbers come in base64 as bytes: first the first one of each single-precision number, then the second, and so on.
function numbers(planes) {
  const bytes = atob(planes), count = bytes.length / 4, whole = new Uint8Array(bytes.length);
  for (let at = 0; at < bytes.length; at += 1) whole[4 * (at % count) + Math.floor(at / count)] = bytes.charCodeAt(at);
  return new Float32Array(whole.buffer);
}

function draw(place) {
  const source = place.querySelector('script');
  if (!source) return;
  const figure = JSON.parse(
    source.textContent, (_, value) => value && value.planes !== undefined ? numbers(value.planes) : value);
  const narrow = place.clientWidth < NARROW;
  source.remove();
  if (narrow) {
    figure.layout.font.size = 11;
    figure.layout.height *= stack(figure.layout);
    place.style.height = figure.layout.height + 'px';
    (figure.layout.annotations || []).forEach(note => { note.font = Object.assign({}, note.font, {size: 11}); });
    const names = figure.layout.yaxis && figure.layout.yaxis.ticktext;
    if (names) {
      figure.layout.yaxis.ticktext = names.map(
        name => name.length > LONGEST ? name.slice(0, LONGEST - 1) + '…' : name);
    }
  }
  Plotly.newPlot(place, figure.data, figure.layout,
    {responsive: true, displaylogo: false, showSendToCloud: false, displayModeBar: narrow ? false : 'hover'});
}

const inSight = new IntersectionObserver(function (seen) {
  seen.filter(each => each.isIntersecting).forEach(each => { inSight.unobserve(each.target); draw(each.target); });
}, {rootMargin: '400px'});

// A table that is cut off at its right gets a hint above it.
const tables = new ResizeObserver(function (seen) {
  seen.forEach(each => { each.target.classList.toggle('cut', each.target.scrollWidth > each.target.clientWidth + 1); });
});
function watch(part) { part.querySelectorAll('.scroll').forEach(place => { tables.observe(place); }); }

// A section may be packed (deflate, base64) in a script until it is chosen, so that many of them make a small page.
async function unpack(section) {
  const source = section.querySelector('script[type="text/plain"]');
  if (!source) return;
  source.remove();
  const bytes = Uint8Array.from(atob(source.textContent), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  section.innerHTML = await new Response(stream).text();
  watch(section);
  section.querySelectorAll('.plot').forEach(place => { inSight.observe(place); });
}

// Or it lies in a file of its own, panes/NAME.js, which is loaded once it is chosen and hands it over here.
async function pane(name, text) {
  const section = document.getElementById('pane');
  if (section.dataset.name !== name) return;
  const script = document.createElement('script');
  script.type = 'text/plain';
  script.textContent = text;
  section.replaceChildren(script);
  await unpack(section);
}

function load(section, name) {
  section.dataset.name = name;
  const script = document.createElement('script');
  script.src = 'panes/' + encodeURIComponent(name) + '.js';
  script.onerror = function () {
    section.textContent = script.src + ' is not there: keep the folder "panes" beside this page.';
  };
  section.replaceChildren(script);
}

// Pages with panes (main > section) show one of them at a time, the first that is not a list if there is one file.
function show() {
  const panes = document.querySelectorAll('main > section');
  if (!panes.length) return;
  const named = location.hash.startsWith('#pane=') && decodeURIComponent(location.hash.slice(6));
  const chosen = document.getElementById(named ? 'pane' : location.hash.slice(1)) || document.querySelector('section[data-first]') || panes[0];
  panes.forEach(pane => { pane.hidden = pane !== chosen; });
  if (named || (chosen.id === 'pane' && chosen.dataset.name)) load(chosen, named || chosen.dataset.name);
  else unpack(chosen);
  document.querySelectorAll('nav a').forEach(function (link) {
    if (link.hash === (named ? location.hash : '#' + chosen.id)) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  });
  window.scrollTo(0, 0);
}

// A link to a folded section opens it.
function unfold() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target && target.tagName === 'DETAILS') { target.open = true; target.scrollIntoView(); }
}

function sort(head) {
  const column = head.cellIndex, body = head.closest('table').tBodies[0];
  const down = head.getAttribute('aria-sort') === 'ascending';
  head.parentNode.querySelectorAll('[aria-sort]').forEach(other => { other.removeAttribute('aria-sort'); });
  head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
  function key(row) {
    const cell = row.cells[column];
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    return cell.classList.contains('none') ? null : cell.textContent;
  }
  Array.from(body.rows).map(row => [key(row), row]).sort(function (a, b) {
    if (a[0] === null || b[0] === null) return (a[0] === null) - (b[0] === null);
    const order = typeof a[0] === 'number' && typeof b[0] === 'number' ? a[0] - b[0]
      : String(a[0]).localeCompare(String(b[0]));
    return down ? -order : order;
  }).forEach(pair => { body.appendChild(pair[1]); });
}

function find(words) {
  const rows = Array.from(document.querySelectorAll('#recordings table:first-of-type tbody tr'));
  rows.forEach(row => { row.hidden = !row.textContent.toLowerCase().includes(words.toLowerCase()); });
  const left = rows.filter(row => !row.hidden).length;
  document.getElementById('found').textContent = words ? left + ' of ' + rows.length : '';
}

function only(button) {
  const was = button.getAttribute('aria-pressed') === 'true';
  document.querySelectorAll('.counts button').forEach(other => { other.setAttribute('aria-pressed', 'false'); });
  button.setAttribute('aria-pressed', was ? 'false' : 'true');
  document.querySelectorAll('tr[data-outcome]').forEach(function (row) {
    row.hidden = !was && row.dataset.outcome !== button.dataset.outcome;
  });
}

document.addEventListener('click', function (event) {
  const head = event.target.closest('.sortable thead tr:last-child th');
  const button = event.target.closest('.counts button');
  if (head) sort(head);
  if (button) only(button);
});
document.addEventListener('input', event => { if (event.target.id === 'find') find(event.target.value); });
window.addEventListener('hashchange', show);
window.addEventListener('hashchange', unfold);
window.addEventListener('DOMContentLoaded', function () {
  watch(document);
  show();
  unfold();
  document.querySelectorAll('.plot').forEach(place => { inSight.observe(place); });
});

// On paper everything is unfolded, and figures are as wide as a page of A4 between its margins.
let opened = [];
function fit(onPaper) {
  document.querySelectorAll('.plot .main-svg:first-of-type').forEach(function (drawn) {
    const place = drawn.closest('.plot'), width = place.closest('.many') ? PAPER / 2 - 5 : PAPER;
    Plotly.relayout(place, onPaper ? {autosize: false, width: width} : {autosize: true, width: null});
  });
}
window.addEventListener('beforeprint', function () {
  opened = Array.from(document.querySelectorAll('details:not([open])'));
  opened.forEach(fold => { fold.open = true; });
  document.querySelectorAll('.plot').forEach(draw);
  fit(true);
});
window.addEventListener('afterprint', function () {
  fit(false);
  opened.forEach(fold => { fold.open = false; });
});
