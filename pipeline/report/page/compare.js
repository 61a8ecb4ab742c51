// What changed: between the map's surveys, and since another map.
if (changedPlaces.length) {
  $('changed-places').hidden = $('changed-places-link').hidden = false;
  const mostRows = 30, anyMoved = changedPlaces.some(change => change.to >= 0), rows = changedPlaces.slice(0, mostRows).map((change, i) => [button(`${metres(change.x / 100)}, ${metres(change.y / 100)}`, () => {
    explainChange(i);
    lookAt([[change.x, change.y]]);
  }), metres(change.radius / 100), change.session, change.gone, change.new, ...(anyMoved ? [changeDestination(change)] : []), changeImage(change.before), changeImage(change.after)]);
  $('changed-places-text').append(element('p', {}, 'Where features of the earlier surveys are gone, or such appeared that these did not see, many together on one surface. What has the features of what is gone elsewhere has moved.'),
    table(rows, ['around', 'radius', 'first seen by', 'gone', 'new', ...(anyMoved ? ['moved to'] : []), 'seen before in', 'seen after in']));
  if (changedPlaces.length > mostRows) $('changed-places-text').append(element('p', {class: 'soft'}, `and ${count(changedPlaces.length - mostRows)} more: the layer \u201Cchanged places\u201D shows all`));
}
if (data.changes) {
  $('changes').hidden = $('changes-link').hidden = false;
  const changes = data.changes, change = value => value > 0 ? `+${count(value)}` : value < 0 ? `\u2212${count(-value)}` : '0';
  const row = (name, [a, b]) => [name.replaceAll('_', ' '), a, b, change(b - a)];
  const figure = value => value === null ? '\u2013' : String(Number(value.toPrecision(4)));
  $('changes-text').append(element('p', {}, `A: ${changes.file}; B: this map`),
    table(['bytes', 'landmarks', 'regions', 'stations', 'stations_not_covered', 'survey_images'].map(name => row(name, changes[name])), ['', 'A', 'B', 'B \u2212 A']),
    element('p', {}, `${counted(changes.num_landmarks_shared, 'landmark is', 'landmarks are')} of both; ${counted(changes.num_regions_changed, 'region differs', 'regions differ')}; `,
      `${counted(changes.coverage_lost.length, 'station')} lost coverage, ${count(changes.coverage_gained.length)} gained it.`));
  if (changes.num_landmarks_shared === 0) $('changes-text').append(element('p', {class: 'bad'}, 'The maps have no landmark in common: are they of one place, in one frame?'));
  const options = Object.entries(changes.options), tests = Object.entries(changes.self_test);
  if (options.length) $('changes-text').append(element('h3', {}, 'Options'), table(options.map(([name, [a, b]]) => [name, String(a), String(b)]), ['', 'A', 'B']));
  if (tests.length) $('changes-text').append(element('h3', {}, 'Self-test'), table(tests.map(([name, [a, b]]) => [name, figure(a), figure(b)]), ['', 'A', 'B']));
}
