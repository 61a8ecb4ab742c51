// The explanation of a station, a region or a held-out image, and how one of them is chosen: click, search, keyboard.
const stationPlace = i => `${metres(S.x[i] / 100)}, ${metres(S.y[i] / 100)}${S.heading[i] === null ? '' : `, looking towards ${S.heading[i]}\u00B0`}`;
function say(...nodes) {
  const close = button('\u00D7', () => { choose({}); sayFirst(); });
  close.className = 'close';
  close.setAttribute('aria-label', 'close');
  $('explanation').replaceChildren(close, ...nodes);
  $('explanation').classList.add('open');
  $('explanation').scrollTop = 0;
  if (isSmallScreen()) $('map').scrollIntoView();  // it is explained below the floor
}
// Before anything is chosen: where to look first.
function sayFirst() {
  const nodes = [element('p', {}, `Click a station, a region${changedPlaces.length ? ', a changed place' : ''} or a ${tried} image, or find one by its number or name: what is seen there, what the stages dropped and why.`)];
  const first = data.advice.filter(entry => entry.weak && entry.stations.length).slice(0, 3);
  if (first.length) {
    nodes.push(element('h3', {}, 'Weakest places'), ...first.map(entry => {
      const test = entry.region !== null && R[entry.region].test;
      const open = button(test && isPoor(test) ? `Region ${entry.region}: ${testText(test).split(';')[0]}` : entry.text.split(/[:.] /)[0].replace(/ \([^)]*\)+/, ''), () => showAdvice(entry));
      open.className = 'wide';
      return open;
    }));
    const num = data.advice.length - first.length;
    if (num > 0) nodes.push(element('p', {}, element('a', {href: '#advice'}, `and ${counted(num, 'other advice', 'other pieces of advice')}`)));
  }
  $('explanation').replaceChildren(...nodes);
  $('explanation').classList.remove('open');
}
// The floor around places, at least six metres of it; where they can be seen well, it stays.
function goTo(places) {
  if (!places.length) return;
  const bounds = leaflet.latLngBounds(places.map(([x, y]) => at(x, y)));
  const center = bounds.getCenter();
  bounds.extend([center.lat - 3, center.lng - 3]).extend([center.lat + 3, center.lng + 3]);
  const shown = map.getBounds();
  if (shown.contains(bounds) && shown.getEast() - shown.getWest() < 4 * Math.max(6, bounds.getEast() - bounds.getWest())) return;
  map.fitBounds(bounds.pad(0.2));
}
// The same from another part of the page.
function lookAt(places) {
  goTo(places);
  $('floor').scrollIntoView();
}
const placesOf = stations => stations.map(i => [S.x[i], S.y[i]]);
function showAdvice(entry) {
  if (entry.views.length) show('images to take');
  if (entry.region !== null) explainRegion(entry.region); else explainStation(entry.stations[0]);
  lookAt(placesOf(entry.stations));
}
function choose({station = -1, region = -1, image = -1, change = -1}) {
  Object.assign(selected, {station, region, image, change});
  redrawAll();
  showLegend();
}
function testText(test) {
  if (!test) return `no ${tried} image was taken there`;
  let text = `${test.localized} of ${counted(test.held_out, `${tried} image`)} localized`;
  if (test.wrong) text += `, ${test.wrong} of them wrong`;
  if (test.median_m !== undefined) text += `; median error ${lengthText(test.median_m)}, ${degrees(test.median_deg)}`;
  return text;
}
// Why a held-out image was not localized, powers of ten written out.
const reason = image => (image.message || 'no reason is known').replace(/10\^(-?[\d.]+)/g, (text, power) => Number((10 ** power).toPrecision(power < 0 ? 1 : 2)).toLocaleString('en', {maximumFractionDigits: 20}));
// What helps against it.
const remedies = {
  too_few_features: 'The image is blank, dark or blurred: no map helps.',
  no_candidates: 'Nothing in the map looks like it: the survey needs images from there, looking this way.',
  too_few_matches: 'Hardly any landmark was recognized: survey images from near there looking this way, or a larger k, would help.',
  no_pose: 'Too few landmarks were recognized correctly: survey images from near there looking this way, or a larger k, would help.',
  too_few_inliers: 'Too few landmarks agree: survey images from near there looking this way, or a larger k, would help.',
  poor_spread: 'The landmarks that agree lie close together in the image: a larger k keeps more of the others.',
  uncertain: 'The landmarks that agree leave the place open: a larger k keeps more of the others.',
  far_from_survey: 'The pose that was found lies where the survey never was.',
  improbable: 'Most of what an image from there would show is missing: it is another place, or the place has changed.',
  ambiguous: 'Another place looks nearly the same: something distinctive on its walls would help.',
};
const outcome = image => image.found ? `${image.wrong ? 'wrong, ' : ''}${lengthText(image.error_m)}, ${degrees(image.error_deg)} off` : `not localized: ${reason(image)}`;
// Those that failed first, each a button.
function heldOutNodes(images) {
  if (!images.length) return [];
  const order = images.slice().sort((a, b) => isBad(heldOut[b]) - isBad(heldOut[a]) || a - b);
  const line = i => element('li', isBad(heldOut[i]) ? {class: 'bad'} : {}, button(heldOut[i].name, () => { explainImage(i); }), ' ', outcome(heldOut[i]));
  const nodes = [element('h3', {}, term('held-out', numRuns ? 'Left-out images' : 'Held-out images'), ' nearest to here'), element('ul', {class: 'plain'}, ...order.slice(0, 12).map(line))];
  if (order.length > 12) nodes.push(element('p', {class: 'soft'}, `and ${order.length - 12} more`));
  return nodes;
}
const adviceNodes = entries => entries.length ? [element('h3', {}, 'What would help'), ...entries.map(entry => element('p', {}, entry.text))] : [];
function explainStation(i) {
  choose({station: i});
  const why = data.drops.find(drop => drop.name === S.why[i]);
  const covered = isUncovered(i) ? element('p', {class: 'bad'}, term('covered'), ': no', why ? `: ${why.text}` : '') : element('p', {}, term('covered'), ': yes');
  const losses = data.drops.filter(drop => drop.at.length && drop.at[i] > 0)
    .map(drop => [drop.at[i], `${drop.kind}${drop.at[i] === 1 ? '' : 's'}`, defined(drop.text, `${drop.name}, ${drop.stage}`)]);
  const nodes = [element('h3', {}, `Station ${i}`), element('p', {class: 'soft'}, stationPlace(i)), covered,
    table([[term('features in view'), S.visible[i]], [term('landmarks seen'), S.seen[i]], ...(data.k ? [[term('k'), data.k]] : []), ...(data.promise && data.promise.at_stations[i] !== null ? [['promised to images here, at least', percent(data.promise.at_stations[i])]] : []), [term('survey images'), S.images[i].length]])];
  if (S.entropy[i] !== null) nodes.push(element('p', {}, term('entropy'), `: ${S.entropy[i].toFixed(2)} nats, as ${Math.exp(S.entropy[i]).toFixed(1)} places alike`));
  if (regionsAt[i].length) nodes.push(element('p', {class: 'buttons'}, 'Regions: ', ...regionsAt[i].map(region => button(String(region), () => explainRegion(region)))));
  nodes.push(...adviceNodes(data.advice.filter(entry => entry.stations.includes(i))), ...heldOutNodes(heldOutAt[i]));
  if (losses.length) nodes.push(element('h3', {}, 'Dropped here'), table(losses));
  nodes.push(element('p', {class: 'soft'}, S.images[i].slice(0, 8).map(image => I.name[image]).join(', ') + (S.images[i].length > 8 ? ' \u2026' : '')));
  say(...nodes);
}
// `others`: regions at the same place.
function explainRegion(i, others = []) {
  choose({region: i});
  const region = R[i];
  const nodes = [element('h3', {}, `Region ${i}`),
    table([['stations', region.stations.length], [term('common landmarks'), region.landmarks.length], ['neighbouring regions', region.adjacent.length]])];
  if (others.length) nodes.splice(1, 0, element('p', {class: 'buttons'}, 'Also here: ', ...others.map(other => button(String(other), () => explainRegion(other, others.map(one => one === other ? i : one))))));
  nodes.push(element('p', region.test && isPoor(region.test) ? {class: 'bad'} : {}, testText(region.test)));
  if (region.entropy !== undefined) nodes.push(element('p', {}, term('entropy'), `: ${region.entropy.toFixed(2)} nats on the mean`));
  nodes.push(...adviceNodes(data.advice.filter(entry => entry.region === i)), ...heldOutNodes(heldOutOf(i)));
  nodes.push(element('h3', {}, 'Stations'), element('p', {class: 'buttons'}, ...region.stations.slice(0, 40).map(station => button(String(station), () => explainStation(station))),
    region.stations.length > 40 ? `and ${region.stations.length - 40} more` : ''));
  say(...nodes);
}
function explainImage(i) {
  choose({image: i});
  show(`${tried} images`);
  const image = heldOut[i], place = ([x, y, heading]) => `${metres(x / 100)}, ${metres(y / 100)}${heading === undefined ? '' : `, ${Math.round(heading)}\u00B0`}`;
  const rows = [['taken at', place(image.at)]];
  if (image.found) rows.push(['localized at', place(image.found)], ['error', `${lengthText(image.error_m)}, ${degrees(image.error_deg)}`]);
  if (image.inliers !== undefined) rows.push([term('inliers'), image.inliers]);
  const nodes = [element('h3', {}, image.name), element('p', {class: 'soft'}, `${tried} image`),
    element('p', isBad(image) ? {class: 'bad'} : {}, image.found ? (image.wrong ? 'localized at a wrong place' : 'localized') : outcome(image)), table(rows)];
  if (image.station === null) nodes.push(element('p', {class: 'bad'}, 'No station is near it: the survey was not there, or did not look this way.'));
  else {
    nodes.push(element('p', {class: 'buttons'}, 'Nearest station: ', button(String(image.station), () => explainStation(image.station)),
      regionsAt[image.station].length ? ' Regions: ' : ' In no region.', ...regionsAt[image.station].map(region => button(String(region), () => explainRegion(region)))));
    const away = Math.hypot(image.at[0] - S.x[image.station], image.at[1] - S.y[image.station]) / 100;
    nodes.push(element('p', {class: 'soft'}, `It was taken ${metres(away)} from that station, and counts for its regions.`));
  }
  if (remedies[image.reason]) nodes.push(element('h3', {}, 'What would help'), element('p', {}, remedies[image.reason]));
  say(...nodes);
}
function explainView(i) {
  const {x, y, heading, advice} = viewsToTake[i], {text, region, stations} = data.advice[advice];
  const about = region !== null ? [button(`region ${region}`, () => explainRegion(region))] : stations.slice(0, 1).map(station => button(`station ${station}`, () => explainStation(station)));
  choose({region: region === null ? -1 : region});
  say(element('h3', {}, 'Image to take'), element('p', {}, `at ${metres(x / 100)}, ${metres(y / 100)}, ${heading === null ? 'in all directions' : `looking towards ${heading}\u00B0`}`),
    element('h3', {}, 'Why'), element('p', {}, text),
    element('p', {class: 'buttons'}, ...about));
}
const changeText = change => `${counted(change.gone, 'feature')} gone, ${count(change.new)} new`;
// An image of a change by its name, which leads to the station where it was taken.
function changeImage(image) {
  if (image < 0) return '\u2013';
  const station = S.images.findIndex(images => images.includes(image));
  return station < 0 ? I.name[image] : button(I.name[image], () => explainStation(station));
}
// Where what was there is now, which leads to that place.
function changeDestination(change) {
  if (change.to < 0) return '\u2013';
  const to = changedPlaces[change.to];
  return button(`${metres(to.x / 100)}, ${metres(to.y / 100)}`, () => {
    explainChange(change.to);
    lookAt([[to.x, to.y]]);
  });
}
const changeRows = change => [['first seen by', change.session], ['features gone', change.gone], ['features new', change.new],
  ...(change.to < 0 ? [] : [['features moved', change.moved], ['moved to', changeDestination(change)]]),
  ['seen before in', changeImage(change.before)], ['seen after in', changeImage(change.after)]];
function explainChange(i) {
  choose({change: i});
  show('changed places');
  const change = changedPlaces[i];
  say(element('h3', {}, 'Changed place'), element('p', {class: 'soft'}, `around ${metres(change.x / 100)}, ${metres(change.y / 100)}; radius ${metres(change.radius / 100)}`), table(changeRows(change)));
}

// ---- what is under the pointer
// The nearest within some pixels, of places in hundredths.
function nearest(latlng, num, placeOf, pixels) {
  const x = 100 * latlng.lng, y = 100 * latlng.lat;
  let found = -1, least = 100 * pixels / scaleNow();
  for (let i = 0; i < num; ++i) {
    const [px, py] = placeOf(i), distance = Math.hypot(px - x, py - y);
    if (distance < least) {
      least = distance;
      found = i;
    }
  }
  return found;
}
// What looks somewhere is drawn ahead of its place.
function aheadOf(x, y, heading, size) {
  if (heading === null) return [x, y];
  const turn = heading * Math.PI / 180, ahead = 60 * size / scaleNow();
  return [x + ahead * Math.cos(turn), y + ahead * Math.sin(turn)];
}
const markPlace = i => aheadOf(S.x[i], S.y[i], S.heading[i], markSize(scaleNow()));
const stationNear = latlng => isShown('stations') || isShown('uncovered') ? nearest(latlng, numStations, markPlace, Math.max(1.3 * markSize(scaleNow()), 9)) : -1;
const imageNear = latlng => isShown(`${tried} images`) ? nearest(latlng, heldOut.length, i => heldOut[i].at, isSmallScreen() ? 12 : 8) : -1;
const viewNear = latlng => isShown('images to take') ? nearest(latlng, viewsToTake.length, i => aheadOf(viewsToTake[i].x, viewsToTake[i].y, viewsToTake[i].heading, viewSize(scaleNow())), 9) : -1;
// The smallest circle of a change around the pointer.
function changeNear(latlng) {
  if (!isShown('changed places')) return -1;
  const away = change => Math.hypot(change.x - 100 * latlng.lng, change.y - 100 * latlng.lat) / 100 * scaleNow();
  return [...changedPlaces.keys()].filter(i => away(changedPlaces[i]) < changedReach(changedPlaces[i], scaleNow()))
    .sort((a, b) => changedPlaces[a].radius - changedPlaces[b].radius)[0] ?? -1;
}
const isSmallScreen = () => window.innerWidth <= 800;
// All stations whose marks are under the pointer, nearest first.
function stationsUnder(latlng) {
  const first = stationNear(latlng);
  if (first < 0) return [];
  const x = 100 * latlng.lng, y = 100 * latlng.lat, reach = 100 * Math.max(0.8 * markSize(scaleNow()), 5) / scaleNow();
  const away = i => { const [px, py] = markPlace(i); return Math.hypot(px - x, py - y); };
  const others = [...S.x.keys()].filter(i => i !== first && away(i) < reach).sort((a, b) => away(a) - away(b));
  return [first, ...others];
}
// Smaller ones first.
function regionsUnder(latlng) {
  const x = 100 * latlng.lng, y = 100 * latlng.lat;
  return hulls.map((corners, i) => i).filter(i => isInHull(hulls[i], x, y)).sort((a, b) => R[a].stations.length - R[b].stations.length || a - b);
}
// What is drawn on top first; clicking on the same place again goes on to what lies below.
const clicked = {point: null, index: 0};
function explainAt(latlng) {
  const image = imageNear(latlng), view = viewNear(latlng);
  const below = [];
  if (image >= 0) below.push(() => explainImage(image));
  if (view >= 0) below.push(() => explainView(view));
  for (const station of stationsUnder(latlng)) below.push(() => explainStation(station));
  const change = changeNear(latlng);
  if (change >= 0) below.push(() => explainChange(change));
  const regions = isShown('regions') ? regionsUnder(latlng) : [];
  for (const region of regions) below.push(() => explainRegion(region, regions.filter(other => other !== region)));
  if (!below.length) return;
  const point = map.latLngToContainerPoint(latlng);
  clicked.index = clicked.point && clicked.point.distanceTo(point) < 6 ? (clicked.index + 1) % below.length : 0;
  clicked.point = point;
  below[clicked.index]();
  if (below.length > 1) $('explanation').append(element('p', {class: 'soft'}, `${clicked.index + 1} of ${below.length} things here: click again for the next`));
}
map.on('zoomstart movestart', () => { clicked.point = null; });
map.on('click', event => explainAt(event.latlng));
const tip = leaflet.tooltip({direction: 'top', offset: [0, -8]});
map.on('mousemove', event => {
  const image = imageNear(event.latlng), view = viewNear(event.latlng), station = stationNear(event.latlng);
  const change = changeNear(event.latlng);
  const regions = image < 0 && view < 0 && station < 0 && change < 0 && isShown('regions') ? regionsUnder(event.latlng) : [];
  $('map').style.cursor = image >= 0 || view >= 0 || station >= 0 || change >= 0 || regions.length ? 'pointer' : '';
  let text = '', place = event.latlng;
  if (image >= 0) {
    text = `${heldOut[image].name}: ${outcome(heldOut[image])}`;
    place = at(...heldOut[image].at);
  } else if (view >= 0) {
    const {x, y, heading} = viewsToTake[view];
    text = `take an image here, ${heading === null ? 'in all directions' : `towards ${heading}\u00B0`}: ${metres(x / 100)}, ${metres(y / 100)}`;
    place = at(x, y);
  } else if (station >= 0) {
    text = `station ${station}: ${counted(S.visible[station], 'feature')} in view, ${counted(S.seen[station], 'landmark')} seen`;
    place = at(S.x[station], S.y[station]);
  } else if (change >= 0) {
    const {x, y, session, before, after} = changedPlaces[change];
    text = [`changed, first seen by ${session}: ${changeText(changedPlaces[change])}`, ...[['before', before], ['after', after]].filter(([, shows]) => shows >= 0).map(([when, shows]) => `${when}: ${I.name[shows]}`)].join('\n');
    place = at(x, y);
  } else if (regions.length) {
    text = regions.slice(0, 4).map(i => `region ${i}: ${counted(R[i].landmarks.length, 'landmark')}${R[i].test ? `, ${R[i].test.localized} of ${R[i].test.held_out} localized` : ''}`).join('\n');
  }
  if (!text) return void map.closeTooltip(tip);
  const content = element('span');
  text.split('\n').forEach((line, i) => content.append(...(i ? [element('br'), line] : [line])));
  tip.setLatLng(place).setContent(content);
  map.openTooltip(tip);
});
// On a phone the explanation is hidden while the floor is out of sight.
new IntersectionObserver(([floor]) => $('explanation').classList.toggle('away', !floor.isIntersecting)).observe($('map'));
map.on('mouseout', () => map.closeTooltip(tip));
$('map').addEventListener('keydown', event => {
  if (event.key === 'Enter' && event.target === $('map')) explainAt(map.getCenter());
});
document.addEventListener('keydown', event => {
  if (event.key !== 'Escape') return;
  choose({});
  sayFirst();
});
$('find').addEventListener('submit', event => {
  event.preventDefault();
  const text = $('query').value.trim();
  if (!text) return;
  const number = Number(text.replace(/[^0-9]/g, ''));
  const named = names => {
    const exact = names.indexOf(text), wanted = text.toLowerCase();
    return exact >= 0 ? exact : names.findIndex(name => name.toLowerCase().startsWith(wanted));
  };
  if (/^(region|r)\s*\d+$/i.test(text) && number < R.length) {
    explainRegion(number);
    return void goTo(placesOf(R[number].stations));
  }
  const isStation = /^(station|s)?\s*\d+$/i.test(text) && number < numStations;
  const held = isStation ? -1 : named(heldOut.map(image => image.name));
  if (held >= 0) {
    explainImage(held);
    return void goTo([heldOut[held].at]);
  }
  const image = isStation ? -1 : named(I.name);
  const station = isStation ? number : image >= 0 ? S.images.findIndex(images => images.includes(image)) : -1;
  if (station < 0) choose({});
  if (station < 0) return say(element('p', {class: 'bad'}, `Nothing here is called \u201C${text}\u201D.`));
  explainStation(station);
  goTo(placesOf([station]));
});
