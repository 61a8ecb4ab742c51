// The floor: Leaflet moves it, every layer is drawn on a canvas of its own.
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
  if (selected.region < 0) return;
  context.lineWidth = 1.5;
  context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue('--ink');
  context.fillStyle = regionColour[selected.region];
  for (const i of R[selected.region].landmarks) {
    const [x, y] = place(L.x[i], L.y[i]);
    context.beginPath();
    context.arc(x, y, 4, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
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
const mostSeen = most(S.visible), mostEntropy = Math.max(0.7, most(S.entropy)), hasEntropy = S.entropy.some(value => value !== null);
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
  ['entropy', drawStations(i => S.entropy[i] === null ? null : shade(S.entropy[i] / mostEntropy)), false, scaleLegend('entropy: places alike', '0 nats: none', `${mostEntropy.toFixed(1)} nats: ${(Math.exp(mostEntropy) - 1).toFixed(1)} others`), hasEntropy],
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
