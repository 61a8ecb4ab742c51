// How the images of a capture without poses were joined: beside the picture, which the program drew.
if (data.reconstruction) {
  const joining = data.reconstruction, rowsShown = 10;
  $('reconstruction').hidden = $('reconstruction-link').hidden = false;
  $('reconstruction-picture').setAttribute('aria-label', `The images from above: ${joining.text}`);
  card(`${count(joining.num_joined)} of ${count(joining.num_images)}`, 'images joined by the reconstruction: see it',
    {bad: !joining.is_whole, action: () => $('reconstruction').scrollIntoView()});
  // A table; of a long one its first rows, and a button for the others.
  const shortened = (title, rows, head, numAll = rows.length) => {
    if (!rows.length) return [];
    const whole = table(rows, head), lines = [...whole.querySelectorAll('tr')].slice(rowsShown + 1);
    lines.forEach(line => { line.hidden = true; });
    const more = lines.length ? button(`show ${lines.length} more`, () => {
      lines.forEach(line => { line.hidden = false; });
      more.remove();
    }) : '';
    const left = numAll > rows.length ? element('p', {class: 'soft'}, `and ${count(numAll - rows.length)} more: reconstruction.json has all`) : '';
    return [element('h3', {}, title), whole, more, left];
  };
  const text = joining.text[0].toUpperCase() + joining.text.slice(1);
  $('reconstruction-verdict').append(element('p', joining.is_whole ? {} : {class: 'bad'}, `${text}.`));
  $('reconstruction-text').append(
    ...shortened('Where it is weak', joining.weak.map(([what, from, to, by]) => [what, to === null ? from : `${from} to ${to}`, by]), ['', 'images', 'points or length']),
    ...shortened(counted(joining.num_loops, 'loop'), joining.loops, ['way', 'from', 'to', 'points in common'], joining.num_loops),
    ...shortened('Not joined with the rest', joining.parts, ['images', 'from', 'to']),
    ...shortened('Folders', joining.folders.map(([name, ...counts]) => [name || '(none)', ...counts]), ['folder', 'joined', 'images', defined('points of others', 'of the points that its images see those that other folders\u2019 images see too')]),
    ...shortened(`${counted(joining.num_missing, 'image')} missing`, joining.missing, ['image', 'why'], joining.num_missing));
}
