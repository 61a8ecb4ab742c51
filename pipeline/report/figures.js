// The other parts of the page: head, advice, line, figures, changes, drive; then all is shown.
const kb = value => value >= 1e6 ? `${(value / 1e6).toFixed(2)} MB` : `${(value / 1e3).toFixed(1)} kB`;
const percent = value => `${(100 * value).toFixed(1)} %`;
$('name').textContent = data.name;
const numCovered = S.covered.filter((covered, i) => covered && S.why[i] === null).length;
$('summary').append(`${kb(data.bytes)}: ${L.x.length} `, term('landmark', 'landmarks'), `, ${R.length} `, term('region', 'regions'),
  data.lower_bound ? ` (at least ${data.lower_bound} are needed)` : '', `, ${numCovered} of ${numStations} `, term('station', 'stations'), ' ', term('covered'),
  data.self_test.localized_ratio !== undefined ? `; ${percent(data.self_test.localized_ratio)} of ${data.self_test.num_held_out} ` : '; no ',
  term('held-out', 'held-out images'), data.self_test.localized_ratio !== undefined ? ' localized' : ' were tried',
  data.self_test.median_error_m !== undefined ? `, median error ${(100 * data.self_test.median_error_m).toFixed(2)} cm` : '');
for (const entry of data.advice) {
  const item = element('li', {}, entry.text);
  if (entry.stations.length) {
    item.append(' ', button('show', () => {
      const region = /^Region (\d+) /.exec(entry.text);
      if (region) explainRegion(Number(region[1])); else explainStation(entry.stations[0]);
      const box = document.querySelector('[data-layer="images to take"]');
      if (box && entry.views.length && !box.checked) box.click();
      goTo(entry.stations);
      $('floor').scrollIntoView();
    }));
  }
  if (entry.views.length) {
    item.append(element('div', {class: 'soft'}, 'images at ' + entry.views.map(([x, y, heading]) => `${metres(x / 100)}, ${metres(y / 100)}${heading === null ? '' : ` towards ${heading}\u00B0`}`).join('; ')));
  }
  $('advice-list').append(item);
}
if (!data.advice.length) $('advice-list').replaceWith(element('p', {}, 'Every station is covered, and no region stands out.'));
// Of many, the most important first.
const hidden = [...$('advice-list').children].slice(10);
if (hidden.length) {
  hidden.forEach(item => { item.hidden = true; });
  const all = button(`show ${hidden.length} more`, () => {
    hidden.forEach(item => { item.hidden = false; });
    all.remove();
  });
  $('advice-list').after(all);
}

// What comes into every stage, what goes on, and what is dropped: a step per stage.
function drawStages() {
  const steps = [];
  const dropsOf = stage => data.drops.filter(drop => drop.stage === stage);
  const build = data.build && data.build.stages ? Object.fromEntries(data.build.stages.map(stage => [stage.stage, stage])) : {};
  const out = (stage, noun) => build[stage] && build[stage].out ? build[stage].out[noun] : undefined;
  const dropped = (stage, kind) => dropsOf(stage).filter(drop => drop.kind === kind).reduce((sum, drop) => sum + drop.num, 0);
  const stageNames = ['group_classes', 'filter_visibility', 'decompose_regions', 'emit_map'];
  let num = L.x.length;
  const list = [['landmarks', num, null]];
  for (const stage of [...stageNames].reverse()) {
    if (stage === 'decompose_regions' && data.landmark_choice === 'all') continue;
    if (stage === 'filter_visibility' && data.landmark_choice === 'all') continue;
    num += dropped(stage, 'feature');
    list.unshift([stage, num, stage]);
  }
  const before = [['images', I.name.length], ['keypoints', out('extract_features', 'keypoints')], ['matches', out('match_features', 'matches')]].filter(([, value]) => value !== undefined);
  const tallest = list[0][1] || 1, width = 200, height = 170;
  const svgSpace = 'http://www.w3.org/2000/svg';
  const make = (tag, attributes, text) => {
    const node = document.createElementNS(svgSpace, tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    return node;
  };
  const most = Math.max(1, ...stageNames.map(stage => dropsOf(stage).filter(drop => drop.kind === 'feature').length));
  const whole = height + 60 + 18 * most;
  const svg = make('svg', {viewBox: `0 0 ${width * (list.length + before.length)} ${whole}`, width: width * (list.length + before.length), height: whole, role: 'img', 'aria-label': 'Stages, what each takes and what it drops'});
  before.forEach(([noun, value], i) => {
    svg.append(make('text', {x: i * width, y: 20, 'font-weight': 600}, noun), make('text', {x: i * width, y: 40}, value.toLocaleString('en')), make('text', {x: i * width + width - 50, y: 30}, '\u2192'));
  });
  list.forEach(([name, value, stage], i) => {
    const x = (i + before.length) * width, tall = Math.max(2, height * value / tallest), after = i + 1 < list.length ? Math.max(2, height * list[i + 1][1] / tallest) : tall;
    svg.append(make('path', {d: `M${x} 50H${x + width - 4}V${50 + after}C${x + width / 2} ${50 + after} ${x + width / 2} ${50 + tall} ${x} ${50 + tall}Z`, fill: '#0072B2', 'fill-opacity': 0.75}));
    svg.append(make('text', {x, y: 20, 'font-weight': 600}, stage ? `into ${name}` : name), make('text', {x, y: 40}, value.toLocaleString('en')));
    if (!stage) return;
    let y = height + 72;
    for (const drop of dropsOf(stage).filter(row => row.kind === 'feature').sort((a, b) => b.num - a.num)) {
      const text = make('text', {x, y, class: 'dropped'}, `\u2212${drop.num.toLocaleString('en')} ${drop.name}`);
      text.append(make('title', {}, drop.text));
      svg.append(text);
      y += 18;
    }
  });
  $('stages').append(svg);
  if (data.build && data.build.stages) {
    $('stages').append(table(data.build.stages.map(stage => [stage.stage, (stage.seconds || 0).toFixed(1), kb(stage.peak_memory_bytes || 0),
      Object.entries(stage.out || {}).map(([noun, value]) => `${value.toLocaleString('en')} ${noun}`).join(', '),
      (stage.rejected || []).map(reject => `${reject.count} ${reject.what}: ${reject.reason}`).join('; ')]), ['stage', 'seconds', 'peak memory', 'made', 'left out']));
  }
  const others = data.drops.filter(drop => drop.kind !== 'feature');
  if (others.length) $('stages').append(element('h3', {}, 'Also dropped'), table(others.map(drop => [drop.num, drop.kind + (drop.num === 1 ? '' : 's'), drop.name, drop.stage, drop.text])));
}
drawStages();

const charts = [];
function chart(caption, labels, values, xTitle, yTitle, horizontal = false) {
  if (!values.some(value => value > 0)) return;
  const canvas = element('canvas', {role: 'img', 'aria-label': `${caption}: ${labels.map((label, i) => `${label} ${values[i]}`).slice(0, 30).join(', ')}`});
  $('charts').append(element('figure', {}, element('figcaption', {}, caption), element('div', {class: 'canvas'}, canvas)));
  const ink = () => getComputedStyle(document.documentElement).getPropertyValue('--ink').trim();
  const grid = () => getComputedStyle(document.documentElement).getPropertyValue('--line').trim();
  const axis = title => ({title: {display: Boolean(title), text: title, color: ink()}, ticks: {color: ink()}, grid: {color: grid()}});
  charts.push(new Chart(canvas, {type: 'bar', data: {labels, datasets: [{data: values, backgroundColor: '#0072B2'}]},
    options: {animation: false, maintainAspectRatio: false, indexAxis: horizontal ? 'y' : 'x', plugins: {legend: {display: false}}, scales: {x: axis(xTitle), y: axis(yTitle)}}}));
}
// About twenty bins of equal width.
function histogram(caption, values, xTitle, yTitle) {
  if (!values.length) return;
  const low = values.reduce((a, b) => Math.min(a, b)), high = most(values), power = Math.pow(10, Math.floor(Math.log10(Math.max((high - low) / 20, 1e-9))));
  const whole = values.every(Number.isInteger);
  const width = Math.max(whole ? 1 : 0, [1, 2, 5, 10].map(factor => factor * power).find(value => value >= (high - low) / 20) || 1);
  const first = Math.floor(low / width), counts = new Array(Math.floor(high / width) - first + 1).fill(0);
  for (const value of values) ++counts[Math.floor(value / width) - first];
  const shown = value => String(Math.round(value * 1000) / 1000);
  chart(caption, counts.map((_, i) => width === 1 && whole ? shown(first + i) : `${shown((first + i) * width)}\u2013${shown((first + i + 1) * width)}`), counts, xTitle, yTitle);
}
function drawCharts() {
  const bytes = data.bytes_by_kind.filter(([, value]) => value > 0).sort((a, b) => b[1] - a[1]);
  chart('Bytes of the map', bytes.map(([kind]) => kind), bytes.map(([, value]) => value), 'bytes', '', true);
  histogram('Landmarks seen from a station', S.seen, 'landmarks', 'stations');
  histogram('Survey images that see a landmark (track length)', L.observations, 'images', 'landmarks');
  if (data.reprojection_errors.length) {
    chart('Reprojection errors of the classes', data.reprojection_errors.map(([tenths]) => (tenths / 10).toFixed(1)), data.reprojection_errors.map(([, num]) => num), 'px (root mean square)', 'classes');
  }
  const tested = R.map((region, i) => [i, region.test]).filter(([, test]) => test);
  chart('Recall by region', tested.map(([i]) => String(i)), tested.map(([, test]) => Math.round(100 * test.localized / test.held_out)), 'region', 'held-out images localized, %');
  const placed = tested.filter(([, test]) => test.median_m !== undefined);
  chart('Median error by region', placed.map(([i]) => String(i)), placed.map(([, test]) => 100 * test.median_m), 'region', 'cm');
  if (data.lower_bound) chart('Regions against their proven lower bound', ['this map', 'least possible'], [R.length, data.lower_bound], 'regions', '', true);
  if (data.pareto && data.pareto.length) chart('Size against recall', data.pareto.map(([bytes]) => kb(bytes)), data.pareto.map(([, ratio]) => Math.round(1000 * ratio) / 10), 'bytes of the map', 'localized, %');
}
const figures = Object.entries(data.self_test);
if (figures.length) $('tables').append(element('h3', {}, 'Self-test'), table(figures.map(([name, value]) => [figureTerms[name] ? element('dfn', {title: figureTerms[name]}, name) : name, Math.round(value * 1e4) / 1e4])));
else $('tables').append(element('p', {}, 'No held-out images were tried: the map has no self-test.'));
for (const [stage, text] of Object.entries(data.options)) $('options-text').append(element('details', {}, element('summary', {}, stage), element('pre', {}, text)));
if (data.changes) {
  $('changes').hidden = $('changes-link').hidden = false;
  const changes = data.changes, row = (name, values) => [name, values[0], values[1], values[1] - values[0]];
  $('changes-text').append(element('p', {}, `A: ${changes.file}; B: this map`),
    table(['bytes', 'landmarks', 'regions', 'stations', 'stations_not_covered', 'survey_images'].map(name => row(name.replaceAll('_', ' '), changes[name])), ['', 'A', 'B', 'B \u2212 A']),
    element('p', {}, `${changes.num_landmarks_shared} landmarks are of both; ${changes.num_regions_changed} regions differ; ${changes.coverage_lost.length} stations lost coverage, ${changes.coverage_gained.length} gained it.`));
  const options = Object.entries(changes.options);
  if (options.length) $('changes-text').append(element('h3', {}, 'Options'), table(options.map(([name, [a, b]]) => [name, String(a), String(b)]), ['', 'A', 'B']));
  const tests = Object.entries(changes.self_test);
  if (tests.length) $('changes-text').append(element('h3', {}, 'Self-test'), table(tests.map(([name, [a, b]]) => [name, a === null ? '-' : Math.round(a * 1e4) / 1e4, b === null ? '-' : Math.round(b * 1e4) / 1e4]), ['', 'A', 'B']));
}
if (data.drive && data.drive.places.length) {
  const last = data.drive.places.length - 1;
  $('drive').hidden = false;
  $('time').max = last;
  const show = value => {
    moment = value;
    $('time').value = value;
    $('moment').textContent = `${value} of ${last}: ${data.drive.places[value][3]}`;
    drawings.drive.redraw();
  };
  $('time').addEventListener('input', () => show(Number($('time').value)));
  let timer = 0;
  $('play').addEventListener('click', () => {
    if (timer) {
      clearInterval(timer);
      timer = 0;
    } else {
      if (moment === last) moment = 0;
      timer = setInterval(() => {
        show(Math.min(moment + 1, last));
        if (moment === last) {
          clearInterval(timer);
          timer = 0;
          $('play').textContent = 'play';
        }
      }, 80);
    }
    $('play').textContent = timer ? 'stop' : 'play';
  });
  moment = last;
  $('time').value = last;
  $('moment').textContent = `${last} of ${last}`;
}

// ---- light and dark
function setTheme(dark) {
  document.documentElement.classList.toggle('dark', dark);
  $('theme').textContent = dark ? 'light' : 'dark';
  $('theme').setAttribute('aria-pressed', String(dark));
  axes.canvas && axes.redraw();
  redrawAll();
  charts.splice(0).forEach(one => one.destroy());
  $('charts').replaceChildren();
  if (chartsDrawn) drawCharts();
}
let chartsDrawn = false;
$('theme').addEventListener('click', () => setTheme(!document.documentElement.classList.contains('dark')));

// ---- first the floor, then the rest
// All stations, and all but the outermost landmarks.
function extent(places, landmarks) {
  const sorted = landmarks.slice().sort((a, b) => a - b), cut = Math.floor(sorted.length / 25);
  const shown = sorted.length ? [sorted[cut], sorted[sorted.length - 1 - cut]] : places.length ? [] : [0, 100];
  return [places.reduce((a, b) => Math.min(a, b), shown[0] ?? Infinity), places.reduce((a, b) => Math.max(a, b), shown[1] ?? -Infinity)];
}
const [west, east] = extent(S.x, L.x), [south, north] = extent(S.y, L.y);
map.fitBounds(leaflet.latLngBounds(L_latlng(west, south), L_latlng(east, north)).pad(0.05));
axes.addTo(map);
for (const [name, , isOn] of layers) if (isOn && drawings[name]) map.addLayer(drawings[name]);
showLegend();
document.documentElement.dataset.floorDrawn = String(Math.round(performance.now()));
setTimeout(() => {
  chartsDrawn = true;
  drawCharts();
  if (window.matchMedia('(prefers-color-scheme: dark)').matches) setTheme(true);
  document.documentElement.dataset.ready = 'yes';
}, 0);
