// The head of the page, the advice, and what the self-test says.
const hasSelfTest = data.self_test.num_held_out > 0 && data.self_test.num_localized !== undefined;
const numCovered = S.x.filter((x, i) => !isUncovered(i)).length;
// Figures of the self-test: the map's own, or else those of the images that were given.
const tested = (() => {
  const figures = data.self_test;
  if (hasSelfTest) {
    return {held_out: figures.num_held_out, localized: figures.num_localized, wrong: figures.num_gross_errors || 0, median_m: figures.median_error_m,
            median_deg: figures.median_error_deg, p90_m: figures.p90_error_m, p90_deg: figures.p90_error_deg};
  }
  return fared(heldOut);
})();
function card(value, caption, {bad = false, action = null} = {}) {
  const content = [element('strong', bad ? {class: 'bad'} : {}, value), element('span', {}, ...[].concat(caption))];
  const item = element('li');
  if (action) {
    const open = button('', action);
    open.append(...content);
    item.append(open);
  } else item.append(...content);
  $('cards').append(item);
}
$('name').textContent = data.name;
card(bytes(data.bytes), data.sealed ? 'sealed map' : 'map, not sealed');
card(count(L.x.length), [term('landmark', L.x.length === 1 ? 'landmark' : 'landmarks'), data.landmark_choice === 'all' ? ': every class' : '']);
card(count(R.length), [term('region', R.length === 1 ? 'region' : 'regions'), data.lower_bound ? `, at least ${data.lower_bound} are needed` : '']);
card(`${count(numCovered)} of ${count(numStations)}`, [term('station', 'stations'), ' ', term('covered')], {bad: numCovered < numStations});
if (data.promise) {
  const P = data.promise;
  card(`${count(P.num_kept)} of ${count(P.num_nodes)}`, ['places and headings keep the ', defined('promise', `${percent(P.probability, 0)} of the images taken there find ${P.min_matches} landmarks at least and are localized within ${lengthText(P.max_error_m)}, ${degrees(P.max_error_deg)}`)], {bad: P.num_kept < P.num_nodes});
}
if (data.scale_sigma_ratio > 0) {
  card(`\u00B1 ${percent(data.scale_sigma_ratio)}`, ['of all lengths: the ', defined('scale', `how long a metre of the map is, by ${data.frame_source.replaceAll('_', ' ')}: one standard deviation; a part of every covariance, and the same error in all of them`)]);
}
if (tested) {
  card(`${tested.localized} of ${tested.held_out}`, [term('held-out', `${tried} images`), ' localized, ', tested.wrong ? `${tested.wrong} of them wrong` : 'none wrong'], {bad: tested.wrong > 0 || tested.localized < data.poor_localized_ratio * tested.held_out});
  if (tested.median_m !== undefined && tested.median_deg !== undefined) {
    card(`${lengthText(tested.median_m)}, ${degrees(tested.median_deg)}`, tested.p90_m === undefined || tested.p90_deg === undefined ? 'median error' : `median error; nine of ten within ${lengthText(tested.p90_m)}, ${degrees(tested.p90_deg)}`);
  }
} else {
  card('not tested', ['no ', term('held-out', 'held-out images'), ' were tried']);
}
if (changedPlaces.length) {
  card(count(changedPlaces.length), `${changedPlaces.length === 1 ? 'place' : 'places'} changed: show ${changedPlaces.length === 1 ? 'it' : 'the first'}`, {action: () => {
    explainChange(0);
    lookAt([[changedPlaces[0].x, changedPlaces[0].y]]);
  }});
}
const weakest = data.advice.find(entry => entry.weak && entry.stations.length);
if (weakest) card(weakest.region === null ? `Station ${weakest.stations[0]}` : `Region ${weakest.region}`, 'weakest place: show it', {bad: true, action: () => showAdvice(weakest)});

for (const entry of data.advice) {
  const item = element('li', {}, entry.text);
  if (entry.stations.length) item.append(' ', button('show', () => showAdvice(entry)));
  if (entry.views.length) {
    const allAround = entry.views.every(([, , heading]) => heading === null);
    item.append(element('div', {class: 'soft'}, `images ${allAround ? 'in all directions ' : ''}at `,
      entry.views.map(([x, y, heading]) => `${metres(x / 100)}, ${metres(y / 100)}${heading === null ? (allAround ? '' : ' in all directions') : ` towards ${heading}\u00B0`}`).join('; ')));
  }
  $('advice-list').append(item);
}
if (!data.advice.length) $('advice-list').replaceWith(element('p', {}, 'Every station is covered, and no region stands out.'));
// Of many, the most important first.
const hidden = [...document.querySelectorAll('#advice-list > li')].slice(10);
if (hidden.length) {
  hidden.forEach(item => { item.hidden = true; });
  const all = button(`show ${hidden.length} more`, () => {
    hidden.forEach(item => { item.hidden = false; });
    all.remove();
  });
  $('advice-list').after(all);
}

// ---- the self-test: what was found, what was asked for
const asked = name => {
  const found = new RegExp(`^${name} = ([-+.\\deE]+)$`, 'm').exec(data.options.check_map || '');
  return found && Number(found[1]) > 0 ? Number(found[1]) : null;
};
function selfTestRows() {
  const f = data.self_test, rows = [];
  const add = (name, value, limit = '', isMissed = false) => {
    const cell = element('span', isMissed ? {class: 'bad'} : {}, value);
    rows.push([name, cell, limit]);
  };
  const atLeast = name => asked(name) === null ? 'not asked' : `at least ${percent(asked(name))}`;
  const isBelow = (value, name) => asked(name) !== null && value < asked(name);
  add('localized', `${f.num_localized} of ${f.num_held_out} (${percent(f.num_localized / f.num_held_out)})`, atLeast('min_localized_ratio'), isBelow(f.num_localized / f.num_held_out, 'min_localized_ratio'));
  const gross = asked('gross_error_m') !== null ? `farther off than ${metres(asked('gross_error_m'))} or ${degrees(asked('gross_error_deg') || 0)}` : 'farther off than the self-test allows';
  if (f.num_gross_errors !== undefined) {
    add(defined('wrong poses', gross), `${f.num_gross_errors} of ${f.num_localized}`, asked('min_precision_ratio') === null ? 'not asked' : `at most ${percent(1 - asked('min_precision_ratio'))}`,
        f.num_gross_errors > 0 && (asked('min_precision_ratio') === null || isBelow(1 - f.num_gross_errors / f.num_localized, 'min_precision_ratio')));
  }
  const all = (...keys) => keys.every(key => f[key] !== undefined);
  if (all('median_error_m', 'median_error_deg')) add('error of half of the poses', `within ${lengthText(f.median_error_m)}, ${degrees(f.median_error_deg)}`);
  if (all('p90_error_m', 'p90_error_deg')) add('error of nine of ten', `within ${lengthText(f.p90_error_m)}, ${degrees(f.p90_error_deg)}`);
  for (const [key, text] of [['within_5cm_5deg_ratio', '5 cm and 5\u00B0'], ['within_10cm_2deg_ratio', '10 cm and 2\u00B0'], ['within_10cm_5deg_ratio', '10 cm and 5\u00B0']]) {
    if (f[key] !== undefined && unit === 'm') add(`of all images within ${text}`, percent(f[key]));
  }
  if (all('mean_nees', 'nees_low', 'nees_high')) {
    const isLarge = f.mean_nees > f.nees_high, isSmall = f.mean_nees < f.nees_low;
    add(defined('errors against stated covariances', 'mean normalised error squared (NEES): squared errors over the covariances that the map states; 6 where these are right'),
        `${f.mean_nees.toFixed(1)}${isLarge ? ': poses are less exact than stated' : isSmall ? ': poses are more exact than stated' : ''}`, `${f.nees_low.toFixed(1)} to ${f.nees_high.toFixed(1)}`, isLarge);
  }
  if (f.num_by_retrieval !== undefined) {
    add(defined('found by retrieval', 'images whose landmarks retrieval led to; of the others the whole map was searched'), count(f.num_by_retrieval), f.all_images_num_by_retrieval === undefined ? '' : `${count(f.all_images_num_by_retrieval)} with all images kept`);
  }
  if (f.all_images_localized_ratio !== undefined) add('localized if all images were kept', percent(f.all_images_localized_ratio));
  if (f.num_promised !== undefined) {
    add(defined('promises kept', 'of the images that stand where the map keeps its promise, those that were localized within its limits by as many landmarks'), `${f.num_promised_kept} of ${f.num_promised}${f.num_beyond_promises > 0 ? `; ${f.num_beyond_promises} images stand where nothing is promised` : ''}`, data.promise ? `at least ${percent(data.promise.probability, 0)}` : '', data.promise && f.num_promised_kept < data.promise.probability * f.num_promised);
  }
  if (f.plan_images_free_ratio !== undefined) add('survey images in rooms of the floor plan', percent(f.plan_images_free_ratio), percent(1));
  if (f.plan_fixes_free_ratio !== undefined) add('poses in rooms of the floor plan', percent(f.plan_fixes_free_ratio), percent(1));
  return rows;
}
function failedNodes() {
  const failed = [...heldOut.keys()].filter(i => isBad(heldOut[i]));
  if (!heldOut.length) return [];
  const source = data.held_out_is_self_test ? '' : ' (of other images than the self-test\u2019s)';
  if (!failed.length) return [element('p', {}, `All ${counted(heldOut.length, `${tried} image`)} were localized right${source}.`)];
  const rows = failed.slice(0, 30).map(i => {
    const image = heldOut[i];
    return [button(image.name, () => {
      explainImage(i);
      lookAt([image.at]);
    }), `${metres(image.at[0] / 100)}, ${metres(image.at[1] / 100)}`, image.station === null ? 'none near' : `${image.station}${regionsAt[image.station].length ? ` (region ${regionsAt[image.station].join(', ')})` : ' (no region)'}`,
            image.found ? outcome(image) : reason(image)];
  });
  return [element('h3', {}, `${counted(failed.length, 'image')} not localized, or wrong${source}`), table(rows, ['image', 'taken at', 'station', 'why']),
          ...(failed.length > 30 ? [element('p', {class: 'soft'}, `and ${failed.length - 30} more: the layer \u201C${tried} images\u201D shows all`)] : [])];
}
if (hasSelfTest) {
  const figures = Object.entries(data.self_test);
  if (numRuns) {
    $('self-test-text').append(element('p', {}, `No images were held out. ${counted(data.self_test.num_held_out, 'image')} of the survey were left out instead, in ${counted(numRuns, 'run')}, and localized in maps that were made without them; this map has them all. Its poses, cameras and visual words were found with them: images of another day can fare worse.`));
  }
  $('self-test-text').append(table(selfTestRows(), ['', 'found', 'asked for']), ...failedNodes(),
    element('details', {}, element('summary', {}, 'all figures, by the names that cairn check gives them'), table(figures.map(([name, value]) => [name, String(Number(value.toPrecision(6)))]))));
} else {
  $('self-test-text').append(element('p', {}, data.sealed ? 'No images were tried: the map has no self-test.' : 'The map is not sealed: it has no self-test.'), ...failedNodes());
}
