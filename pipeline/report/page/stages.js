// The stages: what comes into each, what goes on, and what is dropped and why.
function stageSteps() {
  const dropsOf = stage => data.drops.filter(drop => drop.stage === stage && drop.kind === 'feature').sort((a, b) => b.num - a.num);
  // Maps whose landmarks are not those of regions pass the filter and the regions by.
  const isOfRegions = data.landmark_choice === 'regions';
  const stages = [['group_classes', 'tracks', 'matches of several images that are chained to one feature'],
    ['filter_visibility', 'classes', terms.class], ['decompose_regions', 'visible', 'classes that a robot can expect to see again'],
    ['emit_map', ...(isOfRegions ? ['kept', 'classes that some region keeps'] : ['classes', terms.class])]].filter(([stage]) => isOfRegions || !['filter_visibility', 'decompose_regions'].includes(stage));
  let num = L.x.length;
  const steps = [{noun: 'landmarks', definition: terms.landmark, num, out: num, drops: []}];
  for (const [stage, noun, definition] of stages.reverse()) {
    const drops = dropsOf(stage), out = num;
    num += drops.reduce((sum, drop) => sum + drop.num, 0);
    steps.unshift({stage, noun, definition, num, out, drops});
  }
  return steps;
}
function drawStages() {
  const build = data.stages || [];
  const made = (stage, noun) => (build.find(entry => entry.stage === stage && entry.out) || {out: {}}).out[noun];
  const head = [['images', I.name.length], ['keypoints', made('extract_features', 'keypoints')], ['matches', made('match_features', 'matches')]].filter(([, value]) => value !== undefined);
  $('stages').append(element('p', {class: 'before'}, ...head.flatMap(([noun, value]) => [element('strong', {}, count(value)), ` ${noun} \u2192 `])));
  const flow = element('div', {class: 'flow'});
  const steps = stageSteps(), largest = steps[0].num || 1;
  for (const {stage, noun, definition, num, out, drops} of steps) {
    const shape = element('div', {class: 'shape', role: 'img', 'aria-label': `${count(num)} ${noun}${stage ? `; ${stage} keeps ${count(out)}` : ''}`});
    shape.style.setProperty('--in', Math.max(num / largest, 0.01));
    shape.style.setProperty('--out', Math.max(out / largest, 0.01));
    shape.append(element('i', {class: 'lost'}), element('i', {class: 'kept'}));
    const list = drops.length ? element('ul', {class: 'plain'}, ...drops.map(drop => element('li', {}, `\u2212${count(drop.num)} `, defined(drop.name.replaceAll('_', ' '), drop.text)))) : '';
    flow.append(element('div', {class: 'step'}, element('div', {}, element('strong', {}, count(num)), ' ', defined(noun, definition)), shape,
      element('div', {class: 'soft'}, stage ? `${stage}${drops.length ? ' drops' : ' drops none'}` : ''), list));
  }
  $('stages').append(flow);
  if (data.landmark_choice === 'all') {
    const left = ['filter_visibility', 'decompose_regions'].map(stage => data.drops.filter(drop => drop.stage === stage && drop.kind === 'feature').reduce((sum, drop) => sum + drop.num, 0));
    $('stages').append(element('p', {}, `This map keeps every class ([emit_map] landmarks = "all"), also the ${count(left[0])} that a robot cannot expect to see again and the ${count(left[1])} that no region needs.`));
  }
  if (build.length) {
    // The map's own counts are shown above and below.
    const isTold = reject => data.drops.some(drop => drop.name === reject.reason);
    const rejects = stage => (stage.rejected || []).filter(reject => !isTold(reject)).map(reject => `${reject.count === 1 ? reject.what.replace(/s$/, '') : reject.what}: ${reject.reason}`.replace(/^/, `${count(reject.count)} `)).join('; ');
    const anyRejects = build.some(rejects);
    $('stages').append(element('h3', {}, 'Time and memory'), table(build.map(stage => [stage.stage, `${(stage.seconds || 0).toFixed(1)}`, bytes(stage.peak_memory_bytes || 0),
      Object.entries(stage.out || {}).map(([noun, value]) => noun === 'bytes' ? `${bytes(value)} before sealing` : `${count(value)} ${noun}`).join(', '),
      ...(anyRejects ? [rejects(stage)] : [])]), ['stage', 'seconds', 'peak memory', 'made', ...(anyRejects ? ['left out'] : [])]));
  }
  const others = data.drops.filter(drop => drop.kind !== 'feature');
  if (others.length) $('stages').append(element('h3', {}, 'Also dropped'), table(others.map(drop => [drop.num, drop.kind + (drop.num === 1 ? '' : 's'), drop.name.replaceAll('_', ' '), drop.stage, drop.text])));
}
drawStages();
for (const [stage, text] of Object.entries(data.options)) $('options-text').append(element('details', {}, element('summary', {}, stage), element('pre', {}, text)));
