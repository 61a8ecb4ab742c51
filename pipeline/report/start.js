// Light and dark, and in which order the page is drawn: first the floor, then the rest.
let chartsDrawn = false;
function setTheme(isNowDark) {
  document.documentElement.classList.toggle('dark', isNowDark);
  $('theme').textContent = isNowDark ? 'light' : 'dark';
  $('theme').setAttribute('aria-pressed', String(isNowDark));
  redrawAll();
  showLegend();
  charts.splice(0).forEach(one => one.destroy());
  $('charts').replaceChildren();
  if (chartsDrawn) drawCharts();
}
$('theme').addEventListener('click', () => setTheme(!isDark()));

// All stations and held-out images, and all but the outermost landmarks.
function extent(places, landmarks) {
  const sorted = landmarks.slice().sort((a, b) => a - b), cut = Math.floor(sorted.length / 25);
  const shown = sorted.length ? [sorted[cut], sorted[sorted.length - 1 - cut]] : places.length ? [] : [0, 100];
  return [places.reduce((a, b) => Math.min(a, b), shown[0] ?? Infinity), places.reduce((a, b) => Math.max(a, b), shown[1] ?? -Infinity)];
}
if (isSmallScreen()) $('layers-box').open = false;
document.documentElement.classList.toggle('dark', window.matchMedia('(prefers-color-scheme: dark)').matches);
const [west, east] = extent(S.x.concat(heldOut.map(image => image.at[0])), L.x), [south, north] = extent(S.y.concat(heldOut.map(image => image.at[1])), L.y);
map.fitBounds(leaflet.latLngBounds(at(west, south), at(east, north)).pad(0.05));
axes.addTo(map);
for (const {name, on} of layers) if (on) map.addLayer(drawings[name]);
axisNumbers.addTo(map);
showLegend();
sayFirst();
document.documentElement.dataset.floorDrawn = String(Math.round(performance.now()));
setTimeout(() => {
  chartsDrawn = true;
  setTheme(isDark());
  document.documentElement.dataset.ready = 'yes';
}, 0);
