// The floor: Leaflet moves it, every layer is drawn on a canvas of its own.
const leaflet = window.L;
const at = (x, y) => leaflet.latLng(y / 100, x / 100);
const map = leaflet.map('map', {
  crs: leaflet.CRS.Simple, minZoom: -20, maxZoom: 30, zoomSnap: 0.25, zoomAnimation: false, fadeAnimation: false,
  markerZoomAnimation: false, attributionControl: false, preferCanvas: true, wheelPxPerZoomLevel: 100});
leaflet.control.scale({imperial: false, metric: false}).addTo(map);
const scaleNow = () => map.getZoomScale(map.getZoom(), 0);

// A layer that draws on one canvas a little larger than what is seen: panning moves it, and it is drawn again
// when the pointer is released.
const Drawing = leaflet.Layer.extend({
  initialize(draw, order, isOfDots = false) { Object.assign(this, {draw, order, isOfDots}); },
  onAdd() {
    this.canvas = leaflet.DomUtil.create('canvas', 'leaflet-layer', this.getPane());
    this.canvas.style.pointerEvents = 'none';
    this.canvas.style.zIndex = this.order;
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
    if (this.canvas.width !== whole.x * ratio || this.canvas.height !== whole.y * ratio) {
      this.canvas.width = whole.x * ratio;
      this.canvas.height = whole.y * ratio;
      this.canvas.style.width = whole.x + 'px';
      this.canvas.style.height = whole.y + 'px';
    }
    leaflet.DomUtil.setPosition(this.canvas, low);
    const context = this.canvas.getContext('2d', {willReadFrequently: this.isOfDots});
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.scale(ratio, ratio);
    const origin = map.latLngToLayerPoint([0, 0]).subtract(low), scale = scaleNow();
    const place = (x, y) => [origin.x + x / 100 * scale, origin.y - y / 100 * scale];
    const inside = (px, py) => px > -20 && py > -20 && px < whole.x + 20 && py < whole.y + 20;
    context.save();
    this.draw(context, place, inside, scale, whole);
    context.restore();
  }
});

// The middle of the distances to the next place, for the size of marks.
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
  return distances.length ? quantile(distances, 0.5) : 50;
})();
const markSize = scale => Math.min(Math.max(0.4 * spacing / 100 * scale, 1.5), 22);

// ---- marks.  A wedge points where something looks; what sees all around is a circle.
function wedge(context, x, y, heading, size) {
  context.beginPath();
  if (heading === null || heading === undefined) {
    context.arc(x, y, 0.75 * size, 0, 2 * Math.PI);
    return;
  }
  const turn = heading * Math.PI / 180, cos = Math.cos(turn), sin = Math.sin(turn);
  const point = (forward, left) => [x + size * (forward * cos - left * sin), y - size * (forward * sin + left * cos)];
  context.moveTo(...point(1.15, 0));
  context.lineTo(...point(0.3, 0.38));
  context.lineTo(...point(0.3, -0.38));
  context.closePath();
}
function cross(context, x, y, arm) {
  context.beginPath();
  context.moveTo(x - arm, y - arm);
  context.lineTo(x + arm, y + arm);
  context.moveTo(x + arm, y - arm);
  context.lineTo(x - arm, y + arm);
  context.stroke();
}
function disc(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}
function arrow(context, [x1, y1], [x2, y2]) {
  const turn = Math.atan2(y2 - y1, x2 - x1), head = Math.min(9, Math.hypot(x2 - x1, y2 - y1));
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.lineTo(x2 - head * Math.cos(turn - 0.4), y2 - head * Math.sin(turn - 0.4));
  context.moveTo(x2, y2);
  context.lineTo(x2 - head * Math.cos(turn + 0.4), y2 - head * Math.sin(turn + 0.4));
  context.stroke();
}
// A wedge of where an image looks, from a mark's edge.
function gaze(context, x, y, heading, from, to) {
  if (heading === undefined) return;
  const turn = heading * Math.PI / 180;
  context.beginPath();
  context.moveTo(x + from * Math.cos(turn), y - from * Math.sin(turn));
  context.lineTo(x + to * Math.cos(turn), y - to * Math.sin(turn));
  context.stroke();
}
// Text with the ground around it, to be read above everything.
function label(context, text, x, y, colour = styled('--ink')) {
  context.lineWidth = 3;
  context.lineJoin = 'round';
  context.strokeStyle = styled('--ground');
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

const channels = colour => colour[0] === '#' ? [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16)) : colour.match(/\d+/g).map(Number);
// Square dots of a side, in pixels.  Many are written into the canvas' own pixels: a hundred thousand rectangles would take too long.
const manyDots = 5000;
function dots(context, place, side, xs, ys, colours, colourOf) {
  if (xs.length < manyDots) {
    for (let i = 0; i < xs.length; ++i) {
      const [x, y] = place(xs[i], ys[i]);
      context.fillStyle = colours[colourOf(i)];
      context.fillRect(x - side / 2, y - side / 2, side, side);
    }
    return;
  }
  const {width, height} = context.canvas, ratio = window.devicePixelRatio || 1, whole = Math.max(1, Math.round(side * ratio));
  const image = context.getImageData(0, 0, width, height), pixels = new Uint32Array(image.data.buffer);
  const alpha = Math.round(255 * context.globalAlpha) << 24;
  const values = colours.map(colour => { const [r, g, b] = channels(colour); return (alpha | b << 16 | g << 8 | r) >>> 0; });
  const [left, top] = place(0, 0).map(value => value * ratio - whole / 2), step = (place(100, 0)[0] - place(0, 0)[0]) / 100 * ratio;
  for (let i = 0; i < xs.length; ++i) {
    const x = Math.round(left + step * xs[i]), y = Math.round(top - step * ys[i]);
    if (x < 0 || y < 0 || x + whole > width || y + whole > height) continue;
    const value = values[colourOf(i)];
    for (let row = 0; row < whole; ++row) {
      for (let column = 0; column < whole; ++column) pixels[(y + row) * width + x + column] = value;
    }
  }
  context.putImageData(image, 0, 0);
}

// ---- regions' outlines
// The corners of the hull of stations, counter-clockwise (Andrew's monotone chain), with room around it.
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
const mean = (values, stations) => stations.reduce((sum, station) => sum + values[station], 0) / stations.length;
const regionMiddle = R.map(region => region.stations.length ? [mean(S.x, region.stations), mean(S.y, region.stations)] : null);
function hullPath(context, place, corners) {
  context.beginPath();
  corners.forEach((corner, k) => context[k ? 'lineTo' : 'moveTo'](...place(...corner)));
  context.closePath();
}
const isInHull = (corners, x, y) => corners.length && corners.every(([x1, y1], k) => {
  const [x2, y2] = corners[(k + 1) % corners.length];
  return (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) >= 0;
});
