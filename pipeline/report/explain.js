// What is said of a station or a region.
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
function say(...nodes) {
  $('explanation').replaceChildren(...nodes);
  if (window.innerWidth <= 800) $('explanation').scrollIntoView({block: 'nearest'});  // below the floor there
}
// The floor around stations, at least six metres of it.
function goTo(stations) {
  const bounds = leaflet.latLngBounds(stations.map(i => L_latlng(S.x[i], S.y[i])));
  const center = bounds.getCenter();
  bounds.extend([center.lat - 3, center.lng - 3]).extend([center.lat + 3, center.lng + 3]);
  map.fitBounds(bounds.pad(0.2));
}
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
    table([['stations', region.stations.length], ['common landmarks', region.landmarks.length], ['neighbouring regions', region.adjacent.length]]),
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
$('map').addEventListener('keydown', event => {
  if (event.key !== 'Enter' || event.target !== $('map')) return;
  const station = stationNear(map.getCenter());
  const region = regionAt(map.getCenter());
  if (station >= 0) explainStation(station);
  else if (region >= 0) explainRegion(region);
});
$('find').addEventListener('submit', event => {
  event.preventDefault();
  const text = $('query').value.trim(), number = Number(text.replace(/[^0-9]/g, ''));
  if (/^region\s*\d+$/i.test(text) && number < R.length) {
    explainRegion(number);
    return void goTo(R[number].stations);
  }
  const exact = I.name.indexOf(text), image = exact >= 0 ? exact : text ? I.name.findIndex(name => name.startsWith(text)) : -1;
  const station = /^(station\s*)?\d+$/i.test(text) ? number : image >= 0 ? S.images.findIndex(images => images.includes(image)) : -1;
  if (station < 0 || station >= numStations) return say(element('p', {class: 'bad'}, `Nothing here is called \u201C${text}\u201D.`));
  explainStation(station);
  goTo([station]);
});
