// What the parts of a report share: the object that report_data.cc writes, terms, colours.  Places are in hundredths of the map's unit.
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const $ = id => document.getElementById(id);
const unit = data.unit;
const S = data.stations, R = data.regions, L = data.landmarks, I = data.images;
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

const terms = {
  station: 'a place where the survey stood, with the direction it looked in if the camera sees only forward',
  landmark: 'a feature of the place that the map keeps: robots find where they are by landmarks',
  region: 'neighbouring stations that all see the same k landmarks or more',
  class: 'one feature of the place, seen in several images',
  recall: 'part of the held-out images that the map localizes',
  'held-out': 'images that the map was not made from; they test it',
  entropy: 'how many places look like this one: 0 nats none, 0.69 one other, 1.1 two others',
  kept: 'images that suffice to find the way: every other one is linked to one of them',
  covered: 'some region has this station, and all stations within tau hops of it',
};
const figureTerms = {
  num_held_out: terms['held-out'], num_localized: 'of them, those that got a pose', localized_ratio: 'part of them that got a pose',
  within_5cm_5deg_ratio: 'part of them placed within 5 cm and 5 degrees', within_10cm_2deg_ratio: 'part of them placed within 10 cm and 2 degrees',
  within_10cm_5deg_ratio: 'part of them placed within 10 cm and 5 degrees', num_gross_errors: 'poses that are wrong by more than the self-test allows',
  precision_ratio: 'part of the poses that are not wrong', median_error_m: 'half of the poses are nearer than this, m', median_error_deg: 'half of the poses are turned by less than this, degrees',
  p90_error_m: 'nine of ten poses are nearer than this, m', p90_error_deg: 'nine of ten poses are turned by less than this, degrees',
  mean_nees: 'squared errors over the covariances that the map states; 6 where these are right', median_nees: 'the same, its middle value; 5.35 where they are right',
  nees_low: 'least mean that right covariances would give', nees_high: 'largest mean that right covariances would give',
};
const term = (word, shown = word) => element('dfn', {title: terms[word]}, shown);

// ---- colours that colour-blind readers tell apart: Okabe and Ito's; cividis for amounts
const palette = ['#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '#56B4E9', '#B8A800'];
const cividis = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]];
function shade(part) {
  const at = Math.min(Math.max(part, 0), 1) * (cividis.length - 1), low = Math.floor(at), rest = at - low;
  const high = Math.min(low + 1, cividis.length - 1);
  return `rgb(${cividis[low].map((value, i) => Math.round(value + rest * (cividis[high][i] - value))).join(',')})`;
}
// Neighbouring regions get different colours while there are any.
const regionColour = [];
R.forEach((region, i) => {
  const taken = new Set(region.adjacent.filter(other => other < i).map(other => regionColour[other]));
  const free = palette.filter(colour => !taken.has(colour));
  regionColour.push((free.length ? free : palette)[i % (free.length || palette.length)]);
});
const regionsAt = Array.from({length: numStations}, () => []);
R.forEach((region, i) => region.stations.forEach(station => regionsAt[station].push(i)));
const at = (xs, ys, i) => L_latlng(xs[i], ys[i]);
function L_latlng(x, y) { return window.L.latLng(y / 100, x / 100); }
