// What can be seen on the floor: a drawing per layer.
const selected = {station: -1, region: -1, image: -1, change: -1};
const ground = '#ffffff', dark = '#000000';

const mostSeen = most(S.visible), mostEntropy = Math.max(0.7, most(S.entropy));
const levels = S.visible.map(visible => Math.round(63 * visible / (mostSeen || 1)));
function drawStations(context, place, inside, scale) {
  const size = markSize(scale);
  if (size < 4) dots(context, place, 3, S.x, S.y, shades, i => levels[i]);
  for (let i = 0; i < numStations; ++i) {
    if (size < 4 && i !== selected.station) continue;
    const [x, y] = place(S.x[i], S.y[i]);
    if (!inside(x, y)) continue;
    wedge(context, x, y, S.heading[i], Math.max(size, 4));
    context.fillStyle = shades[levels[i]];
    context.fill();
    if (size > 7) {  // seen against dark ground too
      context.lineWidth = 0.6;
      context.strokeStyle = '#999999';
      context.stroke();
    }
    if (i !== selected.station) continue;
    context.lineWidth = 4;
    context.strokeStyle = dark;
    context.stroke();
    context.lineWidth = 1.5;
    context.strokeStyle = ground;
    context.stroke();
  }
}
// Patches under the stations: x, y and the largest value of the headings at one place; null: no value.
function byPlace(values) {
  const places = new Map();
  values.forEach((value, i) => {
    if (value === null) return;
    const key = `${S.x[i]} ${S.y[i]}`, soFar = places.get(key);
    if (!soFar || soFar[2] < value) places.set(key, [S.x[i], S.y[i], value]);
  });
  return [...places.values()];
}
const heat = byPlace(S.entropy);
// A square around a place, to the next ones.
function patch(context, place, scale, whole, cx, cy, colour) {
  const [x, y] = place(cx, cy), side = Math.max(2, spacing / 100 * scale);
  if (x < -side || y < -side || x > whole.x + side || y > whole.y + side) return;
  context.fillStyle = colour;
  context.fillRect(x - side / 2, y - side / 2, side, side);
}
const heatShade = part => `rgba(213, 94, 0, ${(0.06 + 0.84 * Math.min(Math.max(part, 0), 1)).toFixed(2)})`;
function drawEntropy(context, place, inside, scale, whole) {
  for (const [x, y, value] of heat) patch(context, place, scale, whole, x, y, heatShade(value / mostEntropy));
}
// Calls back for every region in view, large enough to have an outline or not.
function eachRegion(place, whole, callback) {
  hulls.forEach((corners, i) => {
    if (!corners.length) return;
    const shown = corners.map(corner => place(...corner));
    const xs = shown.map(([x]) => x), ys = shown.map(([, y]) => y);
    const [west, east, north, south] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    if (east < 0 || south < 0 || west > whole.x || north > whole.y) return;
    callback(i, corners, Math.max(east - west, south - north), [west, north, east, south]);
  });
}
function drawRegions(context, place, inside, scale, whole) {
  eachRegion(place, whole, (i, corners, size) => {
    const isSelected = i === selected.region, colour = inked(regionColour[i]);
    if (size < 8 && !isSelected) {
      const [x, y] = place(...regionMiddle[i]);
      context.fillStyle = colour;
      context.globalAlpha = 0.5;
      context.fillRect(x - size / 2, y - size / 2, size, size);
      return;
    }
    hullPath(context, place, corners);
    context.fillStyle = colour;
    context.globalAlpha = isSelected ? 0.35 : selected.region >= 0 ? 0.04 : 0.08;
    context.fill();
    context.globalAlpha = isSelected || selected.region < 0 ? 1 : 0.5;
    context.strokeStyle = colour;
    context.lineWidth = isSelected ? 4 : size < 30 ? 0.7 : 1.5;
    context.setLineDash([[], [8, 4], [3, 3]][Math.floor(i / palette.length) % 3]);
    context.stroke();
    context.setLineDash([]);
  });
}
// Of the regions of a station, the one that localizes the smallest part of its held-out images.
const recallClasses = [[1, blue, 'all'], [data.poor_localized_ratio, sky, `${percent(data.poor_localized_ratio, 0)} or more`], [0.5, '#E69F00', 'half or more'], [0, orange, 'less']];
const missed = byPlace(regionsAt.map(regions => regions.map(region => R[region].test).filter(Boolean)
  .reduce((most, test) => Math.max(most, 1 - recall(test)), null)));
const patchAlpha = 0.6;
function drawRecall(context, place, inside, scale, whole) {
  context.globalAlpha = patchAlpha;
  for (const [x, y, part] of missed) patch(context, place, scale, whole, x, y, recallClasses.find(([least]) => 1 - part >= least)[1]);
}
const landmarkColours = [...palette, '#888888'];
const landmarkColour = L.region.map(region => region >= 0 ? palette.indexOf(regionColour[region]) : palette.length);
function drawLandmarks(context, place, inside, scale) {
  context.globalAlpha = selected.region >= 0 ? 0.5 : 1;
  dots(context, place, scale > 60 ? 3 : scale > 8 ? 2 : 1, L.x, L.y, landmarkColours.map(inked), i => landmarkColour[i]);
  if (selected.region < 0) return;
  context.globalAlpha = 1;
  context.lineWidth = 1.5;
  context.strokeStyle = styled('--ink');
  context.fillStyle = inked(regionColour[selected.region]);
  for (const i of R[selected.region].landmarks) {
    disc(context, ...place(L.x[i], L.y[i]), 4);
    context.fill();
    context.stroke();
  }
}
// Lines between images, bent by a part of their length; each as wide as it says.
function lines(context, place, pairs, bow, width) {
  for (const pair of pairs) {
    const [a, b] = pair, [x1, y1] = place(I.x[a], I.y[a]), [x2, y2] = place(I.x[b], I.y[b]);
    context.lineWidth = width(pair);
    context.beginPath();
    context.moveTo(x1, y1);
    context.quadraticCurveTo((x1 + x2) / 2 + bow * (y1 - y2), (y1 + y2) / 2 + bow * (x2 - x1), x2, y2);
    context.stroke();
  }
}
function drawKept(context, place) {
  context.strokeStyle = inked(green);
  context.globalAlpha = I.links.length > 3000 ? 0.15 : 0.5;
  lines(context, place, I.links, 0, () => 1);
  context.globalAlpha = 1;
  for (const i of I.kept) {
    disc(context, ...place(I.x[i], I.y[i]), 5);
    context.fillStyle = inked(green);
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = ground;
    context.stroke();
  }
}
const alike = I.look_alikes.map(([, , score]) => score), mostAlike = most(alike), leastAlike = alike.reduce((a, b) => Math.min(a, b), mostAlike);
function drawLookAlikes(context, place) {
  context.strokeStyle = inked(orange);
  context.globalAlpha = I.look_alikes.length > 1000 ? 0.3 : 0.8;
  lines(context, place, I.look_alikes, 0.25, ([, , score]) => mostAlike > leastAlike ? 1 + 3 * (score - leastAlike) / (mostAlike - leastAlike) : 2);
}
function drawViews(context, place) {
  context.strokeStyle = sky;
  context.lineWidth = 0.7;
  context.globalAlpha = 0.4;
  for (const face of data.views.faces) {
    context.beginPath();
    for (let i = 0; i < face.length; i += 2) context[i ? 'lineTo' : 'moveTo'](...place(face[i], face[i + 1]));
    context.closePath();
    context.stroke();
  }
}
function drawWalls(context, place) {
  context.strokeStyle = styled('--ink');
  context.lineWidth = 2.5;
  for (const [x1, y1, x2, y2] of data.views.walls) {
    context.beginPath();
    context.moveTo(...place(x1, y1));
    context.lineTo(...place(x2, y2));
    context.stroke();
  }
}
const isUncovered = i => !S.covered[i] || S.why[i] !== null;
function drawUncovered(context, place, inside, scale) {
  context.strokeStyle = inked(orange);
  context.lineWidth = 2.5;
  for (let i = 0; i < numStations; ++i) {
    if (!isUncovered(i)) continue;
    const [x, y] = place(...markPlace(i));
    if (inside(x, y)) cross(context, x, y, Math.min(9, Math.max(2.5, 0.4 * markSize(scale))));
  }
}
function drawAdjacency(context, place) {
  context.strokeStyle = context.fillStyle = styled('--soft');
  context.lineWidth = 1.3;
  context.globalAlpha = R.length > 200 ? 0.4 : 1;
  for (const middle of regionMiddle) {
    if (!middle || R.length > 200) continue;
    disc(context, ...place(...middle), 3);
    context.fill();
  }
  R.forEach((region, i) => region.adjacent.forEach(other => {
    if (other < i || !regionMiddle[i] || !regionMiddle[other]) return;
    context.beginPath();
    context.moveTo(...place(...regionMiddle[i]));
    context.lineTo(...place(...regionMiddle[other]));
    context.stroke();
  }));
}
// Localized right: a dot; wrong: a diamond; not localized: a square.  All with a stroke of where they look.
function drawHeldOut(context, place, inside, scale) {
  const size = Math.min(6, Math.max(2, 0.33 * markSize(scale)));
  [...heldOut.keys()].sort((a, b) => isBad(heldOut[a]) - isBad(heldOut[b])).forEach(i => {
    const image = heldOut[i], [x, y] = place(...image.at), isChosen = i === selected.image;
    if (!inside(x, y)) return;
    const colour = !image.found ? inked(orange) : image.wrong ? pink : inked(blue);
    const radius = isBad(image) ? 1.6 * size : size;
    context.strokeStyle = colour;
    context.lineWidth = isBad(image) ? 2.5 : 1.5;
    gaze(context, x, y, image.at[2], radius, 2.2 * radius);
    context.fillStyle = image.found && !image.wrong ? colour : styled('--ground');
    if (!image.found) {
      context.beginPath();
      context.rect(x - 0.8 * radius, y - 0.8 * radius, 1.6 * radius, 1.6 * radius);
    } else if (image.wrong) {
      context.beginPath();
      [[0, -1], [1, 0], [0, 1], [-1, 0]].forEach(([dx, dy], k) => context[k ? 'lineTo' : 'moveTo'](x + radius * dx, y + radius * dy));
      context.closePath();
    } else {
      disc(context, x, y, 0.8 * radius);
    }
    context.fill();
    context.stroke();
    if (!isChosen) return;
    context.strokeStyle = styled('--ink');
    context.lineWidth = 2;
    disc(context, x, y, radius + 5);
    context.stroke();
    if (!image.found) return;
    arrow(context, [x, y], place(...image.found));
  });
}
// Errors are drawn enlarged by this factor, so that they can be seen.
const errorFactor = (() => {
  const errors = heldOut.filter(isLocalized).map(image => image.error_m);
  if (!errors.length) return 1;
  const wanted = 0.5 * spacing / 100 / Math.max(quantile(errors, 0.5), 1e-4);
  return Math.max(1, Math.pow(10, Math.floor(Math.log10(wanted))));
})();
function drawErrors(context, place) {
  context.lineWidth = 2;
  for (const image of heldOut.filter(isLocalized)) {
    context.strokeStyle = image.wrong ? pink : inked(blue);
    const [x, y] = image.at, factor = image.wrong ? 1 : errorFactor;
    arrow(context, place(x, y), place(x + factor * (image.found[0] - x), y + factor * (image.found[1] - y)));
  }
}
const viewsToTake = data.advice.flatMap((entry, advice) => entry.views.map(([x, y, heading]) => ({x, y, heading, advice})));
const viewSize = scale => Math.min(13, Math.max(5, 0.6 * markSize(scale)));
function drawViewsToTake(context, place, inside, scale) {
  const size = viewSize(scale);
  context.lineWidth = 2;
  for (const {x, y, heading} of viewsToTake) {
    wedge(context, ...place(x, y), heading, size);
    context.fillStyle = ground;
    context.globalAlpha = 0.6;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = inked(purple);
    context.stroke();
  }
}
function drawChanges(context, place, inside, scale) {
  const {gone, added} = data.changes;
  dots(context, place, 3, gone.map(([x]) => x), gone.map(([, y]) => y), [inked(orange)], () => 0);
  dots(context, place, 3, added.map(i => L.x[i]), added.map(i => L.y[i]), [inked(blue)], () => 0);
  context.lineWidth = 3;
  for (const [stations, colour] of [[data.changes.coverage_lost, orange], [data.changes.coverage_gained, blue]]) {
    context.strokeStyle = inked(colour);
    for (const i of stations) {
      disc(context, ...place(S.x[i], S.y[i]), 1.4 * markSize(scale));
      context.stroke();
    }
  }
}
// Where the place changed between the map's surveys: a circle as wide as the change, around what changed.
const changedPlaces = data.changed_places;
const isLoss = change => change.gone > change.new;
const changedReach = (change, scale) => Math.max(change.radius / 100 * scale, 6);
function drawChangedPlaces(context, place, inside, scale) {
  changedPlaces.forEach((change, i) => {
    const colour = inked(isLoss(change) ? orange : blue);
    disc(context, ...place(change.x, change.y), changedReach(change, scale));
    context.fillStyle = colour;
    context.globalAlpha = i === selected.change ? 0.4 : 0.18;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = colour;
    context.lineWidth = i === selected.change ? 4 : 2.5;
    context.stroke();
    if (change.to < 0 || change.to === i) return;
    const to = changedPlaces[change.to];
    context.lineWidth = 1.5;
    arrow(context, place(change.x, change.y), place(to.x, to.y));
  });
}
let moment = 0;
function drawDrive(context, place) {
  const places = data.drive.places;
  context.strokeStyle = pink;
  context.lineWidth = 2.5;
  context.beginPath();
  places.slice(0, moment + 1).forEach(([x, y], i) => context[i ? 'lineTo' : 'moveTo'](...place(x, y)));
  context.stroke();
  if (!places.length) return;
  const [x, y, heading] = places[moment];
  wedge(context, ...place(x, y), heading, 16);
  context.fillStyle = pink;
  context.fill();
  context.strokeStyle = dark;
  context.lineWidth = 1;
  context.stroke();
}
const mostNumbers = 150;
// Numbers of regions, and of stations where there is room; none over another.
function drawNumbers(context, place, inside, scale, whole) {
  const taken = [];
  const put = (text, x, y, colour) => {
    const half = context.measureText(text).width / 2 + 2, box = [x - half, y - 8, x + half, y + 8];
    if (!inside(x, y) || taken.some(([x1, y1, x2, y2]) => x1 < box[2] && box[0] < x2 && y1 < box[3] && box[1] < y2)) return false;
    taken.push(box);
    label(context, text, x, y, colour);
    return true;
  };
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.font = '600 13px sans-serif';
  const shown = [];
  if (isShown('regions') || isShown('region adjacency')) eachRegion(place, whole, (i, corners, size, box) => shown.push([i, size, box]));
  shown.sort((a, b) => (b[0] === selected.region) - (a[0] === selected.region) || b[1] - a[1]);
  for (const [i, size, [west, north, east, south]] of shown) {
    if ((size < 28 || shown.length > mostNumbers) && i !== selected.region) break;
    const [x, y] = place(...regionMiddle[i]);
    [[x, y], [x, (y + north) / 2], [x, (y + south) / 2], [(x + west) / 2, y], [(x + east) / 2, y]]
      .some(([px, py]) => put(`R${i}`, px, py, inked(regionColour[i])));
  }
  if (0.4 * spacing / 100 * scale < 28 || !isShown('stations')) return;
  context.font = '11px sans-serif';
  for (let i = 0; i < numStations && taken.length < 2 * mostNumbers; ++i) {
    put(String(i), ...place(...aheadOf(S.x[i], S.y[i], S.heading[i], 1.25 * markSize(scale))));
  }
}
