// The page of a report: draws the object that report_data.cc writes.  Places are in hundredths of the map's unit.
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

// ---- the floor
const leaflet = window.L;
const map = leaflet.map('map', {
  crs: leaflet.CRS.Simple, minZoom: -4, maxZoom: 12, zoomSnap: 0.25, zoomAnimation: false, fadeAnimation: false,
  markerZoomAnimation: false, attributionControl: false, preferCanvas: true, wheelPxPerZoomLevel: 100});
leaflet.control.scale({imperial: false, metric: false}).addTo(map);

// A layer that draws on one canvas a little larger than what is seen: panning moves it, and it is drawn anew
// when the hand lets go.
const Drawing = leaflet.Layer.extend({
  initialize(draw) { this.draw = draw; },
  onAdd() {
    this.canvas = leaflet.DomUtil.create('canvas', 'leaflet-layer', this.getPane());
    this.canvas.style.pointerEvents = 'none';
    map.on('moveend zoomend resize', this.redraw, this);
    this.redraw();
  },
  onRemove() {
    map.off('moveend zoomend resize', this.redraw, this);
    this.canvas.remove();
  },
  redraw() {
    const size = map.getSize(), margin = size.multiplyBy(0.25), ratio = window.devicePixelRatio || 1;
    const low = map.containerPointToLayerPoint(margin.multiplyBy(-1).round());
    const whole = size.add(margin.multiplyBy(2)).round();
    this.canvas.width = whole.x * ratio;
    this.canvas.height = whole.y * ratio;
    this.canvas.style.width = whole.x + 'px';
    this.canvas.style.height = whole.y + 'px';
    leaflet.DomUtil.setPosition(this.canvas, low);
    const context = this.canvas.getContext('2d');
    context.scale(ratio, ratio);
    const origin = map.latLngToLayerPoint([0, 0]).subtract(low), scale = map.getZoomScale(map.getZoom(), 0);
    const place = (x, y) => [origin.x + x / 100 * scale, origin.y - y / 100 * scale];
    const inside = (px, py) => px > -20 && py > -20 && px < whole.x + 20 && py < whole.y + 20;
    this.draw(context, place, inside, scale);
  }
});

// Half the distance to the next place, for the size of marks.
const spacing = (() => {
  const distances = [];
  const step = Math.max(1, Math.floor(numStations / 200));
  for (let i = 0; i < numStations; i += step) {
    let nearest = Infinity;
    for (let j = 0; j < numStations; ++j) {
      const distance = Math.hypot(S.x[i] - S.x[j], S.y[i] - S.y[j]);
      if (distance > 1 && distance < nearest) nearest = distance;
    }
    if (nearest < Infinity) distances.push(nearest);
  }
  distances.sort((a, b) => a - b);
  return distances.length ? distances[Math.floor(distances.length / 2)] : 50;
})();
const markSize = scale => Math.min(Math.max(0.4 * spacing / 100 * scale, 1.5), 22);
function outline(context, x, y, heading, size) {
  context.beginPath();
  if (heading === null) {
    context.arc(x, y, 0.75 * size, 0, 2 * Math.PI);
    return;
  }
  const turn = heading * Math.PI / 180;
  const point = (forward, left) => [x + size * (forward * Math.cos(turn) - left * Math.sin(turn)),
                                    y - size * (forward * Math.sin(turn) + left * Math.cos(turn))];
  context.moveTo(...point(1.15, 0));
  context.lineTo(...point(0.3, 0.38));
  context.lineTo(...point(0.3, -0.38));
  context.closePath();
}
function drawStations(colourOf) {
  return (context, place, inside, scale) => {
    const size = markSize(scale);
    for (let i = 0; i < numStations; ++i) {
      const [x, y] = place(S.x[i], S.y[i]);
      if (!inside(x, y)) continue;
      const colour = colourOf(i);
      if (colour === null) continue;
      outline(context, x, y, S.heading[i], size);
      context.fillStyle = colour;
      context.fill();
      if (size > 5) {  // seen against dark ground too
        context.lineWidth = 0.6;
        context.strokeStyle = '#999999';
        context.stroke();
      }
      if (i === selected.station) {
        context.lineWidth = 3;
        context.strokeStyle = '#000';
        context.stroke();
        context.lineWidth = 1;
        context.strokeStyle = '#fff';
        context.stroke();
      }
    }
  };
}
const selected = {station: -1, region: -1};

// The corners of stations' hull, counter-clockwise (Andrew's monotone chain), with room around it.
function hull(stations) {
  const points = [];
  for (const i of stations) {
    for (let corner = 0; corner < 8; ++corner) {
      points.push([S.x[i] + 0.42 * spacing * Math.cos(corner * Math.PI / 4), S.y[i] + 0.42 * spacing * Math.sin(corner * Math.PI / 4)]);
    }
  }
  points.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const chain = list => {
    const kept = [];
    for (const p of list) {
      while (kept.length > 1) {
        const [a, b] = kept.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        kept.pop();
      }
      kept.push(p);
    }
    return kept.slice(0, -1);
  };
  return chain(points).concat(chain(points.reverse()));
}
const hulls = R.map(region => region.stations.length ? hull(region.stations) : []);
function drawRegions(context, place) {
  hulls.forEach((corners, i) => {
    if (!corners.length) return;
    context.beginPath();
    corners.forEach((corner, k) => context[k ? 'lineTo' : 'moveTo'](...place(...corner)));
    context.closePath();
    context.fillStyle = regionColour[i];
    context.globalAlpha = i === selected.region ? 0.35 : 0.08;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = regionColour[i];
    context.lineWidth = i === selected.region ? 4 : 1.5;
    context.setLineDash([[], [8, 4], [3, 3]][Math.floor(i / palette.length) % 3]);
    context.stroke();
    context.setLineDash([]);
  });
}
function drawLandmarks(context, place, inside, scale) {
  const side = scale > 60 ? 3 : 2;
  for (let i = 0; i < L.x.length; ++i) {
    const [x, y] = place(L.x[i], L.y[i]);
    if (!inside(x, y)) continue;
    context.fillStyle = L.region[i] >= 0 ? regionColour[L.region[i]] : '#888888';
    context.fillRect(x - side / 2, y - side / 2, side, side);
  }
}
function drawLines(pairs, colour, bow) {
  return (context, place) => {
    context.strokeStyle = colour;
    context.globalAlpha = pairs.length > 3000 ? 0.15 : 0.5;
    for (const [a, b] of pairs) {
      const [x1, y1] = place(I.x[a], I.y[a]), [x2, y2] = place(I.x[b], I.y[b]);
      context.beginPath();
      context.moveTo(x1, y1);
      context.quadraticCurveTo((x1 + x2) / 2 + bow * (y1 - y2), (y1 + y2) / 2 + bow * (x2 - x1), x2, y2);
      context.stroke();
    }
    context.globalAlpha = 1;
  };
}
function drawKept(context, place) {
  drawLines(I.links, '#009E73', 0)(context, place);
  for (const i of I.kept) {
    const [x, y] = place(I.x[i], I.y[i]);
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fillStyle = '#009E73';
    context.fill();
    context.strokeStyle = '#ffffff';
    context.stroke();
  }
}
function drawPlan(context, place) {
  context.strokeStyle = '#56B4E9';
  context.lineWidth = 0.7;
  for (const face of data.views.faces) {
    context.beginPath();
    for (let i = 0; i < face.length; i += 2) context[i ? 'lineTo' : 'moveTo'](...place(face[i], face[i + 1]));
    context.closePath();
    context.stroke();
  }
  drawWalls(context, place);
}
function drawWalls(context, place) {
  context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue('--ink');
  context.lineWidth = 2.5;
  for (const [x1, y1, x2, y2] of data.views.walls) {
    context.beginPath();
    context.moveTo(...place(x1, y1));
    context.lineTo(...place(x2, y2));
    context.stroke();
  }
}
function drawUncovered(context, place, inside, scale) {
  const arm = Math.max(4, 0.4 * markSize(scale));
  context.strokeStyle = '#D55E00';
  context.lineWidth = 2.5;
  for (let i = 0; i < numStations; ++i) {
    if (S.covered[i] && S.why[i] === null) continue;
    const [x, y] = place(S.x[i], S.y[i]);
    context.beginPath();
    context.moveTo(x - arm, y - arm);
    context.lineTo(x + arm, y + arm);
    context.moveTo(x + arm, y - arm);
    context.lineTo(x - arm, y + arm);
    context.stroke();
  }
}
function drawAdjacency(context, place) {
  const middle = hulls.map((_, i) => {
    const stations = R[i].stations;
    return [stations.reduce((sum, s) => sum + S.x[s], 0) / stations.length, stations.reduce((sum, s) => sum + S.y[s], 0) / stations.length];
  });
  context.strokeStyle = '#CC79A7';
  context.lineWidth = 2;
  R.forEach((region, i) => region.adjacent.forEach(other => {
    if (other < i) return;
    context.beginPath();
    context.moveTo(...place(...middle[i]));
    context.lineTo(...place(...middle[other]));
    context.stroke();
  }));
}
function arrow(context, [x1, y1], [x2, y2]) {
  const turn = Math.atan2(y2 - y1, x2 - x1), length = Math.hypot(x2 - x1, y2 - y1), head = Math.min(9, length);
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.lineTo(x2 - head * Math.cos(turn - 0.4), y2 - head * Math.sin(turn - 0.4));
  context.moveTo(x2, y2);
  context.lineTo(x2 - head * Math.cos(turn + 0.4), y2 - head * Math.sin(turn + 0.4));
  context.stroke();
}
// Errors are drawn as many times as large, so that they can be seen.
const errorFactor = (() => {
  const errors = (data.self_test_images || []).filter(image => image.found).map(image => image.error_m).sort((a, b) => a - b);
  if (!errors.length) return 1;
  const wanted = 0.5 * spacing / 100 / Math.max(errors[Math.floor(errors.length / 2)], 1e-4);
  return Math.max(1, Math.pow(10, Math.floor(Math.log10(wanted))));
})();
function drawErrors(context, place) {
  context.lineWidth = 2;
  for (const image of data.self_test_images) {
    const [x, y] = [100 * image.true[0], 100 * image.true[1]];
    const from = place(x, y);
    if (!image.found) {
      context.strokeStyle = '#D55E00';
      context.strokeRect(from[0] - 4, from[1] - 4, 8, 8);
      continue;
    }
    context.strokeStyle = '#0072B2';
    arrow(context, from, place(x + errorFactor * (100 * image.found[0] - x), y + errorFactor * (100 * image.found[1] - y)));
  }
}
function drawViewsToTake(context, place, inside, scale) {
  const size = Math.max(7, 0.8 * markSize(scale));
  context.strokeStyle = '#D55E00';
  context.fillStyle = '#ffffff';
  context.lineWidth = 2;
  for (const entry of data.advice) {
    for (const [x, y, heading] of entry.views) {
      outline(context, ...place(x, y), heading, size);
      context.fill();
      context.stroke();
    }
  }
}
function drawChanges(context, place, inside, scale) {
  context.fillStyle = '#D55E00';
  for (const [x, y] of data.changes.gone) {
    const [px, py] = place(x, y);
    if (inside(px, py)) context.fillRect(px - 1.5, py - 1.5, 3, 3);
  }
  context.fillStyle = '#0072B2';
  for (const i of data.changes.added) {
    const [px, py] = place(L.x[i], L.y[i]);
    if (inside(px, py)) context.fillRect(px - 1.5, py - 1.5, 3, 3);
  }
  const size = 1.4 * markSize(scale);
  for (const [stations, colour] of [[data.changes.coverage_lost, '#D55E00'], [data.changes.coverage_gained, '#0072B2']]) {
    context.strokeStyle = colour;
    context.lineWidth = 3;
    for (const i of stations) {
      const [x, y] = place(S.x[i], S.y[i]);
      context.beginPath();
      context.arc(x, y, size, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}
let moment = 0;
function drawDrive(context, place) {
  const places = data.drive.places;
  context.strokeStyle = '#CC79A7';
  context.lineWidth = 2.5;
  context.beginPath();
  places.slice(0, moment + 1).forEach(([x, y], i) => context[i ? 'lineTo' : 'moveTo'](...place(x, y)));
  context.stroke();
  if (!places.length) return;
  const [x, y, heading] = places[moment];
  outline(context, ...place(x, y), heading, 16);
  context.fillStyle = '#CC79A7';
  context.fill();
  context.strokeStyle = '#000000';
  context.lineWidth = 1;
  context.stroke();
}

const most = values => values.reduce((a, b) => Math.max(a, b), 0);
const mostSeen = most(S.visible), hasEntropy = S.entropy.some(value => value !== null);
const scaleLegend = (text, low, high) => () => {
  const bar = element('div', {class: 'bar'});
  bar.style.background = `linear-gradient(to right, ${[0, 0.2, 0.4, 0.6, 0.8, 1].map(shade).join(',')})`;
  return element('div', {}, text, bar, element('div', {class: 'ends'}, element('span', {}, low), element('span', {}, high)));
};
const swatch = (text, colour) => () => {
  const mark = element('span', {}, '\u25A0 ');
  mark.style.color = colour;
  return element('div', {}, mark, text);
};
// name, drawing, whether it is on at first, legend; those that a map has nothing for are left out
const layers = [
  ['floor plan', drawPlan, true, swatch('walls, and regions of the same view', '#56B4E9'), data.views.walls.length > 0],
  ['regions', drawRegions, true, null, R.length > 0],
  ['region adjacency', drawAdjacency, false, swatch('regions with common or neighbouring stations', '#CC79A7'), R.length > 1],
  ['landmarks', drawLandmarks, true, null, L.x.length > 0],
  ['stations', drawStations(i => shade(S.visible[i] / (mostSeen || 1))), true, scaleLegend('stations: features in view', '0', String(mostSeen)), numStations > 0],
  ['entropy', drawStations(i => S.entropy[i] === null ? null : shade(S.entropy[i] / 2.3)), false, scaleLegend('entropy: places alike', '0 nats: none', '2.3 nats: ten'), hasEntropy],
  ['appearance graph', drawKept, false, swatch('kept images and their links', '#009E73'), I.links.length > 0],
  ['look-alikes', drawLines(I.look_alikes, '#D55E00', 0.25), false, swatch('places that look alike', '#D55E00'), I.look_alikes.length > 0],
  ['uncovered', drawUncovered, true, swatch('\u00D7 stations not covered', '#D55E00'), S.covered.some((covered, i) => !covered || S.why[i] !== null)],
  ['images to take', drawViewsToTake, false, swatch('images to take next', '#D55E00'), data.advice.some(entry => entry.views.length > 0)],
  ['self-test errors', drawErrors, false, swatch(`errors of held-out images, ${errorFactor} times as long; squares: not localized`, '#0072B2'), (data.self_test_images || []).length > 0],
  ['changes', data.changes ? drawChanges : null, true, swatch('blue: new landmarks, coverage gained; orange: gone, lost', '#0072B2'), Boolean(data.changes)],
  ['drive', data.drive ? drawDrive : null, true, swatch('the robot\u2019s way', '#CC79A7'), Boolean(data.drive)],
];
const drawings = {};
function showLegend() {
  $('legend').replaceChildren(...layers.filter(([name, , , legend]) => legend && drawings[name] && map.hasLayer(drawings[name])).map(([, , , legend]) => legend()));
}
function redrawAll() {
  for (const drawing of Object.values(drawings)) if (map.hasLayer(drawing)) drawing.redraw();
}
for (const [name, draw, isOn, , exists] of layers) {
  if (!exists) continue;
  drawings[name] = new Drawing(draw);
  const box = element('input', {type: 'checkbox', 'data-layer': name});
  box.checked = isOn;
  box.addEventListener('change', () => {
    if (box.checked) map.addLayer(drawings[name]); else map.removeLayer(drawings[name]);
    showLegend();
  });
  $('layers').append(element('label', {}, box, ' ' + name));
}

// ---- axes in metres
const Axes = Drawing.extend({});
const axes = new Axes((context, place, inside, scale) => {
  const wanted = 90 / scale, power = Math.pow(10, Math.floor(Math.log10(wanted)));
  const step = [1, 2, 5, 10].map(factor => factor * power).find(value => value >= wanted);
  const bounds = map.getBounds(), style = getComputedStyle(document.documentElement);
  context.strokeStyle = style.getPropertyValue('--line');
  context.fillStyle = style.getPropertyValue('--soft');
  context.font = '12px sans-serif';
  const size = map.getSize(), margin = size.multiplyBy(0.25);
  const shown = value => `${Math.round(value * 100) / 100} ${unit}`;
  for (let x = Math.ceil(bounds.getWest() / step) * step; x <= bounds.getEast(); x += step) {
    const [px] = place(100 * x, 0);
    context.beginPath();
    context.moveTo(px, 0);
    context.lineTo(px, 3 * size.y);
    context.stroke();
    context.fillText(shown(x), px + 3, margin.y + size.y - 6);
  }
  for (let y = Math.ceil(bounds.getSouth() / step) * step; y <= bounds.getNorth(); y += step) {
    const [, py] = place(0, 100 * y);
    context.beginPath();
    context.moveTo(0, py);
    context.lineTo(3 * size.x, py);
    context.stroke();
    context.fillText(shown(y), margin.x + 50, py - 3);
  }
});

// ---- choosing a station or a region, and what is said of it
function table(rows, head) {
  const node = element('table');
  const isNumber = cell => typeof cell === 'number' || (typeof cell === 'string' && /^[-\d.,]+( [kM]B)?$/.test(cell));
  const style = cell => isNumber(cell) ? {class: 'num'} : {};
  if (head) node.append(element('tr', {}, ...head.map((text, i) => element('th', rows.length ? style(rows[0][i]) : {}, text))));
  for (const row of rows) node.append(element('tr', {}, ...row.map(cell => element('td', style(cell), typeof cell === 'number' ? String(cell) : cell))));
  return node;
}
const metres = (value, digits = 2) => `${value.toFixed(digits)} ${unit}`;
const placeText = i => `${metres(S.x[i] / 100)}, ${metres(S.y[i] / 100)}${S.heading[i] === null ? '' : `, looking towards ${S.heading[i]}\u00B0`}`;
function button(text, action) {
  const node = element('button', {type: 'button'}, text);
  node.addEventListener('click', action);
  return node;
}
function say(...nodes) { $('explanation').replaceChildren(...nodes); }
function testText(test) {
  if (!test) return 'no held-out image';
  let text = `${test.localized} of ${test.held_out} held-out images localized`;
  if (test.wrong) text += `, ${test.wrong} of them wrong`;
  if (test.median_m !== undefined) text += `; median error ${(100 * test.median_m).toFixed(1)} cm, ${test.median_deg.toFixed(2)}\u00B0`;
  return text;
}
function explainStation(i) {
  selected.station = i;
  selected.region = -1;
  redrawAll();
  const why = data.drops.find(drop => drop.name === S.why[i]);
  const covered = S.covered[i] && !why ? element('p', {}, term('covered'), ': yes')
    : element('p', {class: 'bad'}, term('covered'), ': no', why ? `: ${why.text}` : '');
  const losses = data.drops.filter(drop => drop.at.length && drop.at[i] > 0).map(drop => [drop.at[i], `${drop.kind}${drop.at[i] === 1 ? '' : 's'}`, element('dfn', {title: `${drop.stage}: ${drop.text}`}, drop.name)]);
  const nodes = [element('h3', {}, `Station ${i}`), element('p', {class: 'soft'}, placeText(i)), covered,
    table([['features in view', S.visible[i]], ['landmarks seen', S.seen[i]], ['k', data.k], ['survey images', S.images[i].length]])];
  if (S.entropy[i] !== null) nodes.push(element('p', {}, term('entropy'), `: ${S.entropy[i].toFixed(2)} nats, as ${Math.exp(S.entropy[i]).toFixed(1)} places alike`));
  if (regionsAt[i].length) nodes.push(element('p', {}, 'Regions: ', ...regionsAt[i].map(region => button(String(region), () => explainRegion(region)))));
  if (losses.length) nodes.push(element('h3', {}, 'Dropped here'), table(losses));
  const helpful = data.advice.filter(entry => entry.stations.includes(i));
  if (helpful.length) nodes.push(element('h3', {}, 'What would help'), ...helpful.map(entry => element('p', {}, entry.text)));
  nodes.push(element('p', {class: 'soft'}, S.images[i].slice(0, 8).map(image => I.name[image]).join(', ') + (S.images[i].length > 8 ? ' \u2026' : '')));
  say(...nodes);
}
function explainRegion(i) {
  selected.station = -1;
  selected.region = i;
  redrawAll();
  const region = R[i];
  const nodes = [element('h3', {}, `Region ${i}`),
    table([['stations', region.stations.length], ['common landmarks', region.num_landmarks], ['neighbouring regions', region.adjacent.length]]),
    element('p', {}, 'Self-test: ' + testText(region.test))];
  if (region.entropy !== undefined) nodes.push(element('p', {}, term('entropy'), `: ${region.entropy.toFixed(2)} nats on the mean`));
  const helpful = data.advice.filter(entry => entry.text.startsWith(`Region ${i} `));
  nodes.push(...helpful.map(entry => element('p', {}, entry.text)));
  nodes.push(element('p', {}, 'Stations: ', ...region.stations.slice(0, 40).map(station => button(String(station), () => explainStation(station)))));
  say(...nodes);
}
function stationNear(latlng) {
  const x = 100 * latlng.lng, y = 100 * latlng.lat;
  const scale = map.getZoomScale(map.getZoom(), 0), mark = markSize(scale) / scale * 100;
  let nearest = -1, least = Math.max(1.3 * mark, 900 / scale);
  for (let i = 0; i < numStations; ++i) {
    // A station with a heading is drawn ahead of its place.
    const turn = (S.heading[i] || 0) * Math.PI / 180, ahead = S.heading[i] === null ? 0 : 0.6 * mark;
    const distance = Math.hypot(S.x[i] + ahead * Math.cos(turn) - x, S.y[i] + ahead * Math.sin(turn) - y);
    if (distance < least) {
      least = distance;
      nearest = i;
    }
  }
  return nearest;
}
function regionAt(latlng) {
  const x = 100 * latlng.lng, y = 100 * latlng.lat;
  return hulls.findIndex(corners => corners.length && corners.every(([x1, y1], k) => {
    const [x2, y2] = corners[(k + 1) % corners.length];
    return (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) >= 0;
  }));
}
map.on('click', event => {
  const station = stationNear(event.latlng);
  if (station >= 0) return explainStation(station);
  const region = regionAt(event.latlng);
  if (region >= 0) explainRegion(region);
});
const tip = leaflet.tooltip({direction: 'top', offset: [0, -8]});
map.on('mousemove', event => {
  const station = stationNear(event.latlng);
  if (station < 0) return void map.closeTooltip(tip);
  tip.setLatLng(L_latlng(S.x[station], S.y[station])).setContent(`station ${station}: ${S.visible[station]} features, ${S.seen[station]} landmarks`);
  map.openTooltip(tip);
});
$('find').addEventListener('submit', event => {
  event.preventDefault();
  const text = $('query').value.trim(), number = Number(text.replace(/[^0-9]/g, ''));
  if (/^region\s*\d+$/i.test(text) && number < R.length) {
    explainRegion(number);
    return void map.panTo(L_latlng(S.x[R[number].stations[0]], S.y[R[number].stations[0]]));
  }
  const image = I.name.indexOf(text);
  const station = image >= 0 ? S.images.findIndex(images => images.includes(image)) : /^(station\s*)?\d+$/i.test(text) ? number : -1;
  if (station < 0 || station >= numStations) return say(element('p', {class: 'bad'}, `Nothing here is called \u201C${text}\u201D.`));
  explainStation(station);
  map.panTo(L_latlng(S.x[station], S.y[station]));
});

// ---- head, advice, line, figures
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
      explainStation(entry.stations[0]);
      const box = document.querySelector('[data-layer="images to take"]');
      if (box && entry.views.length && !box.checked) box.click();
      map.fitBounds(leaflet.latLngBounds(entry.stations.map(i => L_latlng(S.x[i], S.y[i]))).pad(1), {maxZoom: 7});
      $('floor').scrollIntoView();
    }));
  }
  if (entry.views.length) {
    item.append(element('div', {class: 'soft'}, 'images at ' + entry.views.map(([x, y, heading]) => `${metres(x / 100)}, ${metres(y / 100)}${heading === null ? '' : ` towards ${heading}\u00B0`}`).join('; ')));
  }
  $('advice-list').append(item);
}
if (!data.advice.length) $('advice-list').replaceWith(element('p', {}, 'Nothing to say against this map.'));

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
  const tallest = list[0][1] || 1, width = 180, height = 170;
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
for (const [stage, text] of Object.entries(data.options)) $('options-text').append(element('h3', {}, stage), element('pre', {}, text));
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
const xs = S.x.concat(L.x.length <= 20000 ? L.x : []), ys = S.y.concat(L.x.length <= 20000 ? L.y : []);
function extent(values) {
  const sorted = values.slice().sort((a, b) => a - b), cut = Math.floor(sorted.length / 100);
  return sorted.length ? [sorted[cut], sorted[sorted.length - 1 - cut]] : [0, 100];
}
const [west, east] = extent(xs), [south, north] = extent(ys);
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
