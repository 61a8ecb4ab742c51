// Light and dark, and in which order the page is drawn: first the floor, then the rest.
function markTheme(isNowDark) {
  document.documentElement.classList.toggle('dark', isNowDark);
  $('theme').textContent = isNowDark ? 'light' : 'dark';
  $('theme').setAttribute('aria-pressed', String(isNowDark));
}
function setTheme(isNowDark) {
  markTheme(isNowDark);
  redrawAll();
  showLegend();
  charts.splice(0).forEach(one => one.destroy());
  $('charts').replaceChildren();
  drawCharts();
}
// The theme chosen last on this machine; the system's where the browser does not store it.
function keptTheme() {
  try { return localStorage.getItem('cairn report theme'); } catch (error) { return null; }
}
$('theme').addEventListener('click', () => {
  setTheme(!isDark());
  try { localStorage.setItem('cairn report theme', isDark() ? 'dark' : 'light'); } catch (error) { /* it may keep nothing */ }
});

// All stations and held-out images, and all but the outermost landmarks.
function extent(places, landmarks) {
  const sorted = landmarks.slice().sort((a, b) => a - b), cut = Math.floor(sorted.length / 25);
  const shown = sorted.length ? [sorted[cut], sorted[sorted.length - 1 - cut]] : places.length ? [] : [0, 100];
  return [places.reduce((a, b) => Math.min(a, b), shown[0] ?? Infinity), places.reduce((a, b) => Math.max(a, b), shown[1] ?? -Infinity)];
}
if (isSmallScreen()) $('layers-box').open = false;
markTheme(keptTheme() ? keptTheme() === 'dark' : window.matchMedia('(prefers-color-scheme: dark)').matches);
const [west, east] = extent(S.x.concat(heldOut.map(image => image.at[0])), L.x), [south, north] = extent(S.y.concat(heldOut.map(image => image.at[1])), L.y);
const everything = leaflet.latLngBounds(at(west, south), at(east, north)).pad(0.05);
map.fitBounds(everything);
map.setMinZoom(map.getZoom() - 3);
map.setMaxZoom(Math.max(map.getZoom() + 2, Math.log2(22 / (0.4 * spacing / 100)) + 3));
const fit = leaflet.control({position: 'topleft'});
fit.onAdd = () => {
  const bar = element('div', {class: 'leaflet-bar'}), link = element('a', {href: '#floor', role: 'button', title: 'all of the floor', 'aria-label': 'all of the floor'}, 'all');
  link.style.fontSize = '12px';
  leaflet.DomEvent.on(link, 'click', event => {
    leaflet.DomEvent.stop(event);
    map.fitBounds(everything);
  });
  bar.append(link);
  return bar;
};
fit.addTo(map);
axes.addTo(map);
for (const {name, on} of layers) if (on) map.addLayer(drawings[name]);
axisNumbers.addTo(map);
showLegend();
sayFirst();
document.documentElement.dataset.floorDrawn = String(Math.round(performance.now()));
setTimeout(() => {
  drawCharts();
  document.documentElement.dataset.ready = 'yes';
}, 0);
