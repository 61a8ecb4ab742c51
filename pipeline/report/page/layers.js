// The layers, from the lowest to the highest, the boxes that switch them, their legends, and the axes.
// ---- legends: the mark as it is drawn, and what it means
function mark(kind, colour) {
  const shapes = {line: 'M1 7H21', bow: 'M1 12Q11 0 21 12', cross: 'M7 3l8 8m0-8l-8 8', ring: 'M11 2a5 5 0 1 0 .1 0z', disc: 'M11 2a5 5 0 1 0 .1 0z',
    square: 'M7 3h8v8h-8z', block: 'M6 2h10v10h-10z', diamond: 'M11 1l6 6l-6 6l-6-6z', wedge: 'M20 7L8 11.5V2.5z', dot: 'M9.5 5.5h3v3h-3z', arrow: 'M2 7H18m-5-4l5 4l-5 4'};
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  for (const [key, value] of Object.entries({viewBox: '0 0 22 14', width: 22, height: 14, 'aria-hidden': 'true'})) svg.setAttribute(key, value);
  path.setAttribute('d', shapes[kind]);
  path.setAttribute('stroke', kind === 'block' ? colour : inked(colour));
  path.setAttribute('stroke-width', 2);
  if (kind === 'block') path.setAttribute('opacity', patchAlpha);
  path.setAttribute('fill', kind === 'block' ? colour : ['disc', 'dot'].includes(kind) ? inked(colour) : 'none');
  svg.append(path);
  return svg;
}
const scaleOf = (colourOf, text, low, high) => {
  const bar = element('div', {class: 'bar'});
  bar.style.background = `linear-gradient(to right, ${[0, 0.2, 0.4, 0.6, 0.8, 1].map(colourOf).join(',')})`;
  return element('div', {}, text, bar, element('div', {class: 'ends'}, element('span', {}, low), element('span', {}, high)));
};
const says = (...marks) => () => element('div', {}, ...marks.map(([kind, colour, text]) => element('span', {class: 'key'}, mark(kind, colour), ` ${text} `)));

// Layers without content in a map are left out.
const layers = [
  {name: 'recall', group: 'how well', draw: drawRecall, exists: missed.length > 0,
   legend: () => element('div', {}, `of the regions there, the one that localizes the smallest part of its ${tried} images: `, ...recallClasses.map(([, colour, text]) => element('span', {class: 'key'}, mark('block', colour), ` ${text} `)))},
  {name: 'entropy', group: 'how well', draw: drawEntropy, exists: heat.length > 0,
   legend: () => scaleOf(heatShade, 'entropy, and the number of places that look alike', '0 nats: 1 place', `${mostEntropy.toFixed(2)} nats: ${Math.exp(mostEntropy).toFixed(1)} places`)},
  {name: 'regions', group: 'the map', draw: drawRegions, on: true, exists: R.length > 0,
   legend: () => element('div', {}, mark('ring', palette[0]), ' regions; colours and dashes only tell neighbours apart')},
  {name: 'views', group: 'the map', draw: drawViews, exists: data.views.faces.length > 0,
   legend: says(['line', sky, 'view-invariant regions of the floor plan: inside of one the same walls are in sight'])},
  {name: 'walls', group: 'the map', draw: drawWalls, on: true, exists: data.views.walls.length > 0,
   legend: () => element('div', {}, mark('line', styled('--ink')), ' walls of the floor plan')},
  {name: 'region adjacency', group: 'the map', draw: drawAdjacency, exists: R.length > 1, legend: () => element('div', {}, mark('line', styled('--soft')), ' regions with common or neighbouring stations')},
  {name: 'appearance graph', group: 'images', draw: drawKept, exists: I.links.length > 0,
   legend: says(['disc', green, counted(I.kept.length, 'kept image')], ['line', green, counted(I.links.length, 'link') + ' of them'])},
  {name: 'look-alikes', group: 'images', draw: drawLookAlikes, exists: I.look_alikes.length > 0,
   legend: says(['bow', orange, 'images of different places that look alike; the wider, the more'])},
  {name: 'landmarks', group: 'the map', draw: drawLandmarks, isOfDots: L.x.length >= manyDots, on: true, exists: L.x.length > 0,
   legend: () => element('div', {}, ...(R.length ? [element('span', {class: 'key'}, ...[...new Set(regionColour)].slice(0, 3).map(colour => mark('dot', colour)), ' landmarks, in the colour of a region ')] : []),
     ...(L.region.some(region => region < 0) ? [element('span', {class: 'key'}, mark('dot', '#888888'), R.length ? ' of no region ' : ' landmarks')] : []),
     ...(selected.region >= 0 ? [element('span', {class: 'key'}, mark('disc', regionColour[selected.region]), ` of region ${selected.region}`)] : []))},
  {name: 'stations', group: 'the map', draw: drawStations, on: true, exists: numStations > 0,
   legend: () => scaleOf(shade, 'stations: features in view', '0', count(mostSeen))},
  {name: 'uncovered', group: 'how well', draw: drawUncovered, on: true, exists: S.x.some((x, i) => isUncovered(i)),
   legend: says(['cross', orange, 'stations not covered'])},
  {name: 'self-test errors', group: 'how well', draw: drawErrors, exists: heldOut.some(isLocalized),
   legend: () => element('div', {}, mark('arrow', blue), ` from where an image was taken to where the map puts it${errorFactor > 1 ? `, ${errorFactor} times as long` : ''}`)},
  {name: 'images to take', group: 'images', draw: drawViewsToTake, exists: viewsToTake.length > 0,
   legend: says(...[['wedge', purple, 'images to take next', true], ['ring', purple, 'images to take next, in all directions', false]].filter(([, , , hasHeading]) => viewsToTake.some(view => (view.heading !== null) === hasHeading)))},
  {name: `${tried} images`, group: 'how well', draw: drawHeldOut, on: true, exists: heldOut.length > 0,
   legend: says(['disc', blue, 'localized'], ['square', orange, 'not localized'], ...(heldOut.some(image => image.wrong) ? [['diamond', pink, 'wrong']] : []))},
  {name: 'changes', group: 'the map', draw: drawChanges, on: true, exists: Boolean(data.changes),
   legend: says(['dot', blue, 'new landmarks'], ['ring', blue, 'coverage gained'], ['dot', orange, 'landmarks gone'], ['ring', orange, 'coverage lost'])},
  {name: 'changed places', group: 'the map', draw: drawChangedPlaces, on: true, exists: changedPlaces.length > 0,
   legend: says(...[[true, orange, 'places that changed: more gone than new'], [false, blue, 'places that changed: as many new as gone, or more']]
     .filter(([loss]) => changedPlaces.some(change => isLoss(change) === loss)).map(([, colour, text]) => ['ring', colour, text]),
   ...(changedPlaces.some((change, i) => change.to >= 0 && change.to !== i) ? [['arrow', orange, 'what was there is here now']] : []))},
  {name: 'drive', group: 'images', draw: drawDrive, on: true, exists: Boolean(data.drive), legend: says(['wedge', pink, 'the robot and its way'])},
  {name: 'numbers', group: 'the map', draw: drawNumbers, on: true, exists: numStations > 0,
   legend: () => element('div', {}, R.length ? 'R0: region 0; stations have their numbers when zoomed in' : 'stations have their numbers when zoomed in')},
].filter(layer => layer.exists);
const drawings = {};
const isShown = name => Boolean(drawings[name]) && map.hasLayer(drawings[name]);
function showLegend() {
  $('legend').replaceChildren(...layers.filter(layer => layer.legend && isShown(layer.name)).map(layer => layer.legend()));
}
function redrawAll() {
  for (const drawing of Object.values(drawings)) if (map.hasLayer(drawing)) drawing.redraw();
  for (const drawing of [axes, axisNumbers]) if (map.hasLayer(drawing)) drawing.redraw();
}
function show(name, isOn = true) {
  const box = document.querySelector(`[data-layer="${name}"]`);
  if (box && box.checked !== isOn) box.click();
}
for (const group of ['the map', 'how well', 'images']) {
  const members = layers.filter(layer => layer.group === group);
  if (!members.length) continue;
  const set = element('fieldset', {}, element('legend', {}, group));
  for (const layer of members) {
    const drawing = drawings[layer.name] = new Drawing(layer.draw, 10 + layers.indexOf(layer), layer.isOfDots);
    const box = element('input', {type: 'checkbox', 'data-layer': layer.name});
    box.checked = Boolean(layer.on);
    box.addEventListener('change', () => {
      if (box.checked) map.addLayer(drawing); else map.removeLayer(drawing);
      if (isShown('numbers')) drawings.numbers.redraw();
      showLegend();
    });
    set.append(element('label', {}, box, ' ' + layer.name));
  }
  $('layers').append(set);
}

// ---- axes in metres: lines under everything, their numbers above everything
function eachTick(scale, callback) {
  const wanted = 90 / scale, power = Math.pow(10, Math.floor(Math.log10(wanted)));
  const step = [1, 2, 5, 10].map(factor => factor * power).find(value => value >= wanted);
  const bounds = map.getBounds();
  const shown = value => `${count(Math.round(value * 100) / 100 || 0)} ${unit}`;
  for (let x = Math.ceil(bounds.getWest() / step) * step; x <= bounds.getEast(); x += step) callback(x, null, shown(x));
  for (let y = Math.ceil(bounds.getSouth() / step) * step; y <= bounds.getNorth(); y += step) callback(null, y, shown(y));
}
const axes = new Drawing((context, place, inside, scale, whole) => {
  context.strokeStyle = styled('--line');
  eachTick(scale, (x, y) => {
    const [px, py] = place(100 * (x || 0), 100 * (y || 0));
    context.beginPath();
    if (y === null) {
      context.moveTo(px, 0);
      context.lineTo(px, whole.y);
    } else {
      context.moveTo(0, py);
      context.lineTo(whole.x, py);
    }
    context.stroke();
  });
}, 1);
const axisNumbers = new Drawing((context, place, inside, scale) => {
  const size = map.getSize(), margin = size.multiplyBy(0.25).round(), colour = styled('--soft');
  context.font = '12px sans-serif';
  eachTick(scale, (x, y, text) => {
    const [px, py] = place(100 * (x || 0), 100 * (y || 0));
    if (y === null) label(context, text, px + 3, margin.y + size.y - 6, colour);
    else if (py > margin.y + 130 && py < margin.y + size.y - 24) label(context, text, margin.x + 4, py - 3, colour);
  });
}, 90);
