// The figures, drawn by Chart.js.
const charts = [];
const mostBars = 40;
function chart(caption, config, description) {
  const title = element('figcaption', {}, ...[].concat(caption));
  const canvas = element('canvas', {role: 'img', 'aria-label': `${title.textContent}: ${description}`});
  $('charts').append(element('figure', {}, title, element('div', {class: 'canvas'}, canvas)));
  config.options = {animation: false, maintainAspectRatio: false, ...config.options};
  charts.push(new Chart(canvas, config));
}
const axis = (title, rest = {}) => ({title: {display: Boolean(title), text: title, color: styled('--ink')}, ticks: {color: styled('--ink'), ...rest.ticks}, grid: {color: styled('--line')}, ...(rest.type ? {type: rest.type} : {}), ...(rest.scale || {})});
// `colours`: one for all, or one per bar; `told`: the tooltip's line per bar; `onPick`: called with the bar that is clicked.
function bars(caption, labels, values, xTitle, yTitle, {horizontal = false, colours = inked(blue), told = null, onPick = null, yScale = {}, ticks = {}} = {}) {
  if (!values.some(value => value > 0) && !onPick) return;
  chart(caption, {type: 'bar', data: {labels, datasets: [{data: values, backgroundColor: colours, minBarLength: onPick ? 3 : 0}]}, options: {
    indexAxis: horizontal ? 'y' : 'x',
    interaction: onPick ? {mode: 'index', intersect: false} : {},
    plugins: {legend: {display: false}, tooltip: told ? {callbacks: {title: () => '', label: item => told[item.dataIndex].split('; ')}} : {}},
    onClick: onPick ? (event, items) => items.length && onPick(items[0].index) : undefined,
    onHover: onPick ? (event, items) => { event.native.target.style.cursor = items.length ? 'pointer' : ''; } : undefined,
    scales: {x: axis(xTitle, {ticks: {...(onPick ? {autoSkip: false} : {}), ...ticks}}), y: axis(yTitle, {scale: yScale})}}}, labels.map((text, i) => `${text} ${Math.round(100 * values[i]) / 100}`).slice(0, 30).join(', '));
}
// About twenty bins of equal width.
function histogram(caption, values, xTitle, yTitle) {
  if (!values.length) return;
  const low = values.reduce((a, b) => Math.min(a, b)), high = most(values), power = Math.pow(10, Math.floor(Math.log10(Math.max((high - low) / 20, 1e-9))));
  const whole = values.every(Number.isInteger);
  const width = Math.max(whole ? 1 : 0, [1, 2, 5, 10].map(factor => factor * power).find(value => value >= (high - low) / 20) || 1);
  const first = Math.floor(low / width), counts = new Array(Math.floor(high / width) - first + 1).fill(0);
  for (const value of values) ++counts[Math.floor(value / width) - first];
  const shown = value => count(Math.round(value * 1000) / 1000), last = whole ? 1 : 0;
  bars(caption, counts.map((_, i) => width === 1 && whole ? shown(first + i) : `${shown((first + i) * width)}\u2013${shown((first + i + 1) * width - last)}`), counts, xTitle, yTitle);
}
function pickRegion(region) {
  explainRegion(region);
  lookAt(placesOf(R[region].stations));
}
function drawRegionCharts() {
  const all = R.map((region, i) => [i, region.test]).filter(([, test]) => test).sort((a, b) => recall(a[1]) - recall(b[1]) || b[1].held_out - a[1].held_out || a[0] - b[0]);
  const which = all.length > mostBars ? `, the ${mostBars} worst of ${all.length}` : ', worst first';
  const worst = all.slice(0, mostBars);
  const told = ([i, test]) => `region ${i}: ${testText(test)}`;
  if (worst.length) {
    bars([term('recall', 'Recall'), ` by region${which}; orange: below ${percent(data.poor_localized_ratio, 0)}; click a bar to see its region`], worst.map(([i]) => String(i)), worst.map(([, test]) => Math.round(1000 * recall(test)) / 10), 'region', 'localized right, %',
         {colours: worst.map(([, test]) => isPoor(test) ? inked(orange) : inked(blue)), told: worst.map(told), onPick: bar => pickRegion(worst[bar][0]), yScale: {min: 0, max: 100}});
  }
  const farthest = all.filter(([, test]) => test.median_m !== undefined).sort((a, b) => b[1].median_m - a[1].median_m).slice(0, mostBars), factor = unit === 'm' ? 100 : 1;
  if (farthest.length) {
    bars('Median error by region, largest first; click a bar', farthest.map(([i]) => String(i)), farthest.map(([, test]) => factor * test.median_m), 'region', unit === 'm' ? 'cm' : unit, {told: farthest.map(told), onPick: bar => pickRegion(farthest[bar][0])});
  }
}
// What the two charts above show, for the keyboard and for reading aloud.
function regionTable() {
  const rows = R.map((region, i) => [i, region.test]).filter(([, test]) => test);
  if (!rows.length) return;
  $('charts').append(element('details', {class: 'whole'}, element('summary', {}, 'recall and error by region, as a table'),
    table(rows.slice(0, 500).map(([i, test]) => [button(String(i), () => pickRegion(i)), test.held_out, test.localized, test.wrong, test.median_m === undefined ? '' : lengthText(test.median_m), test.p90_m === undefined ? '' : lengthText(test.p90_m)]),
          ['region', `${tried} images`, 'localized', 'wrong', 'median error', 'nine of ten within'])));
}
// Maps of other sizes, and this one among them.
function drawSizes() {
  if (!data.pareto.length) return;
  const line = (text, key, colour, dash) => ({type: 'line', clip: false, label: text, data: data.pareto.map(point => ({x: point.bytes, y: 100 * point[key], point})), borderColor: colour, backgroundColor: colour, borderDash: dash, pointRadius: 3, borderWidth: 2});
  const sets = [line('localized', 'localized', inked(blue), []), line('within 10 cm, 5\u00B0', 'within', inked(green), [5, 3])];
  if (data.self_test.localized_ratio !== undefined) {
    sets.unshift({type: 'scatter', clip: false, label: 'this map', data: [{x: data.bytes, y: 100 * data.self_test.localized_ratio, point: {median_m: data.self_test.median_error_m ?? null}}], pointStyle: 'triangle', pointRadius: 8, borderColor: inked(orange), backgroundColor: inked(orange)});
  }
  chart('Size against recall', {type: 'line', data: {datasets: sets}, options: {
    plugins: {legend: {labels: {color: styled('--ink'), usePointStyle: true}}, tooltip: {callbacks: {label: item => `${item.dataset.label}: ${bytes(item.raw.x)}, ${item.raw.y.toFixed(1)} %${item.raw.point.median_m === null ? '' : `, median error ${lengthText(item.raw.point.median_m)}`}`}}},
    scales: {x: axis('bytes of the map', {type: 'logarithmic', ticks: {callback: value => /^[125]/.test(String(value)) ? roundBytes(value) : '', maxRotation: 0}}), y: axis(`${tried} images, %`, {scale: {max: 100}})}}},
    data.pareto.map(point => `${bytes(point.bytes)} ${percent(point.localized)}`).join(', '));
}
// How often promises of about the same probability were kept: on the line where the map knows what it says.
function drawPromises() {
  if (!data.promise) return;
  const set = (text, curve, colour, pointStyle) => ({type: 'scatter', clip: false, label: text, data: curve.map(([promised, kept, tried]) => ({x: 100 * promised, y: 100 * kept / tried, kept, tried})), pointStyle, pointRadius: curve.map(([, , tried]) => 4 + 2 * Math.log10(tried)), borderColor: colour, backgroundColor: colour});
  const sets = [set('left-out survey images', data.promise.left_out, inked(blue), 'circle'), set('held-out images', data.promise.held_out, inked(orange), 'triangle')].filter(one => one.data.length);
  if (!sets.length) return;
  sets.push({type: 'line', label: 'as promised', data: [{x: 0, y: 0}, {x: 100, y: 100}], borderColor: styled('--line'), borderDash: [5, 3], borderWidth: 2, pointRadius: 0});
  chart('Promised and kept: each mark stands for images with about the same promise, a larger one for more', {type: 'scatter', data: {datasets: sets}, options: {
    plugins: {legend: {labels: {color: styled('--ink'), usePointStyle: true}}, tooltip: {callbacks: {label: item => item.raw.tried === undefined ? '' : `${item.dataset.label}: ${item.raw.x.toFixed(1)} % promised, ${item.raw.kept} of ${item.raw.tried} kept`}}},
    scales: {x: axis('promised, %', {scale: {min: 0, max: 100}}), y: axis('kept, %', {scale: {min: 0, max: 100}})}}},
    sets.filter(one => one.type === 'scatter').map(one => `${one.label}: ${one.data.map(point => `${point.kept} of ${point.tried} at ${Math.round(point.x)} %`).join(', ')}`).join('; '));
}
function drawCharts() {
  drawRegionCharts();
  regionTable();
  drawPromises();
  histogram('Landmarks seen from a station', S.seen, 'landmarks', 'stations');
  drawSizes();
  if (data.lower_bound) bars('Regions against their proven lower bound', ['this map', 'least possible'], [R.length, data.lower_bound], 'regions', '', {horizontal: true, ticks: {precision: 0}});
  const kinds = data.bytes_by_kind.filter(([, value]) => value > 0).sort((a, b) => b[1] - a[1]);
  bars('Bytes of the map', kinds.map(([kind]) => kind), kinds.map(([, value]) => value), '', '', {horizontal: true, ticks: {callback: value => roundBytes(value), maxRotation: 0}, told: kinds.map(([, value]) => `${bytes(value)}, ${percent(value / data.bytes)}`)});
  histogram('Survey images that see a landmark (track length)', L.observations, 'images', 'landmarks');
  if (data.reprojection_errors.length) {
    const tenths = new Map(data.reprojection_errors), last = most([...tenths.keys()]), bins = Array.from({length: Math.min(last, 200) + 1}, (_, i) => i);
    bars('Reprojection errors of the classes', bins.map(i => (i / 10).toFixed(1)), bins.map(i => tenths.get(i) || 0), 'px (root mean square)', 'classes');
  }
}
