// What the parts of a report share: the object that report_data.cc writes, terms, colours, numbers.  Places are in hundredths of the
// map's unit.
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const $ = id => document.getElementById(id);
const unit = data.unit;
const S = data.stations, R = data.regions, L = data.landmarks, I = data.images;
const heldOut = data.held_out || [];
const numStations = S.x.length;

// Text goes into the page as text, never as markup: names may hold anything.
function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === 'class') node.className = value; else node.setAttribute(key, value);
  }
  for (const child of children) node.append(child);
  return node;
}
function button(text, action) {
  const node = element('button', {type: 'button'}, text);
  node.addEventListener('click', action);
  return node;
}
// Rows of cells; numbers stand right.
function table(rows, head) {
  const node = element('table');
  const isNumber = cell => typeof cell === 'number' || (typeof cell === 'string' && /^[-+\u2212\d.,]+( [kM]B)?$/.test(cell));
  const style = cell => isNumber(cell) ? {class: 'num'} : {};
  if (head) node.append(element('tr', {}, ...head.map((text, i) => element('th', rows.length ? style(rows[0][i]) : {}, text))));
  for (const row of rows) node.append(element('tr', {}, ...row.map(cell => element('td', style(cell), typeof cell === 'number' ? count(cell) : cell))));
  return element('div', {class: 'scroll'}, node);
}

// ---- numbers
const count = value => value.toLocaleString('en');
const counted = (num, noun, nouns = noun + 's') => `${count(num)} ${num === 1 ? noun : nouns}`;
const bytes = value => value >= 1e6 ? `${(value / 1e6).toFixed(2)} MB` : `${(value / 1e3).toFixed(1)} kB`;
// Without decimals that are zero, for axes.
const roundBytes = value => bytes(value).replace(/\.0+ /, ' ');
const percent = (value, digits = 1) => `${(100 * value).toFixed(digits)} %`;
const metres = (value, digits = 2) => `${value.toFixed(digits)} ${unit}`;
// Short lengths in centimetres, where the unit is the metre; else with two digits that say something.
const inUnits = value => metres(value, value > 0 && value < 1 ? Math.min(6, 1 - Math.floor(Math.log10(value))) : 2);
const lengthText = value => unit !== 'm' || value >= 1 ? inUnits(value) : `${(100 * value).toFixed(value < 0.01 ? 2 : 1)} cm`;
const degrees = value => `${value.toFixed(value < 1 ? 2 : 1)}\u00B0`;
const most = values => values.reduce((a, b) => Math.max(a, b), 0);
const quantile = (values, part) => values.slice().sort((a, b) => a - b)[Math.ceil(part * values.length) - 1];

// ---- terms
// What tried the map: images that were held out, or else runs of the survey's own, in maps without them.
const numRuns = data.self_test.num_left_out_runs || 0;
const tried = numRuns ? 'left-out' : 'held-out';
const terms = {
  station: 'a place where the survey stood, with the direction it looked in if the camera sees only forward',
  landmark: 'a feature of the place that the map keeps: robots find where they are by landmarks',
  'features in view': 'features of the place that a robot at the station can expect to see, kept by the map or not',
  'landmarks seen': 'landmarks that the survey images taken at the station see' + (data.landmark_choice === 'all' ? '; this map keeps every class, also those that a robot cannot expect to see again' : ''),
  'common landmarks': 'landmarks that are seen from every station of the region: by them a robot there is localized',
  region: 'neighbouring stations that all see the same k landmarks or more',
  k: 'the minimum number of common landmarks of a region, [decompose_regions] k',
  class: 'one feature of the place, seen in several images',
  'held-out': numRuns ? 'runs of the survey\u2019s images: they test maps that were made without them' : 'images that the map was not made from; they test it',
  recall: `part of the ${tried} images that the map localizes`,
  entropy: 'how many places look like this one, itself counted: 0 nats one, 0.69 two, 1.1 three',
  covered: data.tau > 0 ? `some region has this station, and all stations within tau = ${data.tau} hops of it` : 'some region has this station',
  inliers: 'landmarks that agree with the pose that was found',
  'survey images': 'images taken at the station, of which the map is made',
};
const term = (word, shown = word) => element('dfn', {title: terms[word], tabindex: '0'}, shown);
const defined = (text, definition) => element('dfn', {title: definition, tabindex: '0'}, text);
// On a touch screen, and by keyboard, a definition is shown below its term.
function showDefinition(event) {
  const dfn = event.target.closest && event.target.closest('dfn');
  $('definition').hidden = !dfn;
  if (!dfn) return;
  $('definition').textContent = dfn.title;
  const box = dfn.getBoundingClientRect();
  $('definition').style.top = `${box.bottom + window.scrollY + 4}px`;
  $('definition').style.left = `${Math.max(8, Math.min(box.left, document.documentElement.clientWidth - 300))}px`;
}
document.addEventListener('click', showDefinition);
document.addEventListener('focusin', showDefinition);
document.addEventListener('keydown', event => {
  if (event.key === 'Escape') $('definition').hidden = true;
});

// ---- colours that colour-blind readers tell apart: Okabe and Ito's; cividis for amounts
const blue = '#0072B2', orange = '#D55E00', green = '#009E73', pink = '#CC79A7', sky = '#56B4E9', purple = '#A0468A';
const palette = [blue, '#E69F00', green, orange, pink, sky, '#B8A800'];
const onDark = {[blue]: '#4FA8E8', [green]: '#2FC79B', [orange]: '#FF8A3D', [purple]: '#E58BD0'};
const isDark = () => document.documentElement.classList.contains('dark');
// The same colour, light enough for the dark ground.
const inked = colour => isDark() && onDark[colour] || colour;
const styled = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const cividis = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]];
const shades = [];
for (let i = 0; i < 64; ++i) {
  const at = i / 63 * (cividis.length - 1), low = Math.min(Math.floor(at), cividis.length - 2);
  shades.push(`rgb(${cividis[low].map((value, k) => Math.round(value + (at - low) * (cividis[low + 1][k] - value))).join(',')})`);
}
const shade = part => shades[Math.round(63 * Math.min(Math.max(part, 0), 1))];

// ---- regions and held-out images, by station
// Neighbouring regions get different colours while there are any.
const regionColour = [];
R.forEach((region, i) => {
  const taken = new Set(region.adjacent.filter(other => other < i).map(other => regionColour[other]));
  const free = palette.filter(colour => !taken.has(colour));
  regionColour.push((free.length ? free : palette)[i % (free.length || palette.length)]);
});
const regionsAt = Array.from({length: numStations}, () => []);
R.forEach((region, i) => region.stations.forEach(station => regionsAt[station].push(i)));
const heldOutAt = Array.from({length: numStations}, () => []);
heldOut.forEach((image, i) => image.station !== null && heldOutAt[image.station].push(i));
const isLocalized = image => Boolean(image.found);
const isBad = image => !image.found || image.wrong;
const heldOutOf = region => [...new Set(R[region].stations.flatMap(station => heldOutAt[station]))].sort((a, b) => a - b);
// The results of images, in the form of a region's self-test; nothing where there are none.
function fared(images) {
  if (!images.length) return undefined;
  const placed = images.filter(isLocalized), test = {held_out: images.length, localized: placed.length, wrong: placed.filter(isBad).length};
  if (!placed.length) return test;
  const part = (key, at) => quantile(placed.map(image => image[key]), at);
  return {...test, median_m: part('error_m', 0.5), median_deg: part('error_deg', 0.5), p90_m: part('error_m', 0.9), p90_deg: part('error_deg', 0.9)};
}
// Where a map is not sealed, or was checked with other images, its regions have the results of these images.
if (heldOut.length && !data.held_out_is_self_test) R.forEach((region, i) => { region.test = fared(heldOutOf(i).map(image => heldOut[image])); });
const recall = test => (test.localized - test.wrong) / test.held_out;
const isPoor = test => recall(test) < data.poor_localized_ratio;
