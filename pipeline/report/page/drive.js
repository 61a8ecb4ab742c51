// A recorded drive, replayed on the floor.
if (data.drive && data.drive.places.length) {
  const last = data.drive.places.length - 1;
  $('drive').hidden = false;
  $('time').max = last;
  const showMoment = value => {
    moment = value;
    $('time').value = value;
    $('moment').textContent = `${value} of ${last}: ${data.drive.places[value][3]}`;
    if (isShown('drive')) drawings.drive.redraw();
  };
  $('time').addEventListener('input', () => showMoment(Number($('time').value)));
  let timer = 0;
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    $('play').textContent = 'play';
  };
  $('play').addEventListener('click', () => {
    if (timer) return stop();
    if (moment === last) moment = 0;
    $('play').textContent = 'stop';
    timer = setInterval(() => {
      showMoment(Math.min(moment + 1, last));
      if (moment === last) stop();
    }, 80);
  });
  showMoment(last);
}
