#!/usr/bin/env python3
"""How a report behaves in Chromium:  large_report.py CAIRN MAP...   (or MAKE_MAP instead of maps: a large one is made)

Prints the file's size, the seconds to make it, the milliseconds until the floor is drawn, and how long a redraw
takes after panning and zooming, until the frame is shown: the median and the longest of 26.
"""
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

# Pans, and zooms in and out over eight steps, from all of the floor to single stations; the time until the next frame.
MOVE = '''const done = arguments[0], took = [], start = map.getZoom();
const moves = [];
for (const zoom of [1, 2, 3, 4, 5, 4, 3, 2, 1, 0, -1, -2, 0]) moves.push(() => map.setZoom(start + zoom, {animate: false}), () => map.panBy([120, 60], {animate: false}));
function next() {
  if (!moves.length) return done(took);
  const begin = performance.now();
  moves.shift()();
  requestAnimationFrame(() => setTimeout(() => { took.push(performance.now() - begin); next(); }));
}
next();'''


def measure(cairn, map_path):
    page = os.path.join(tempfile.mkdtemp(), 'report.html')
    begin = time.monotonic()
    subprocess.run([cairn, 'report', map_path, '-o', page], check=True, stdout=subprocess.DEVNULL)
    made = time.monotonic() - begin
    options = Options()
    for argument in ['--headless=new', '--no-sandbox', '--disable-gpu', '--window-size=1400,1000']:
        options.add_argument(argument)
    driver = webdriver.Chrome(service=Service('/usr/bin/chromedriver'), options=options)
    drawn = []
    for _ in range(3):
        driver.get(pathlib.Path(page).as_uri())
        while driver.execute_script('return document.documentElement.dataset.ready') != 'yes':
            time.sleep(0.1)
        drawn.append(float(driver.execute_script('return document.documentElement.dataset.floorDrawn')))
    moves = driver.execute_async_script(MOVE)
    driver.quit()
    print(f'{os.path.basename(map_path)}: {os.path.getsize(page) / 1e6:.2f} MB, made in {made:.2f} s, floor drawn after '
          f'{statistics.median(drawn):.0f} ms, pan or zoom {statistics.median(moves):.0f} ms, at most {max(moves):.0f} ms')


def main():
    cairn, *maps = sys.argv[1:]
    if len(maps) == 1 and not maps[0].endswith('.cairn'):
        large = os.path.join(tempfile.mkdtemp(), 'large.cairn')
        subprocess.run([maps[0], large, '100000', '20000', '1500'], check=True)
        maps = [large]
    for map_path in maps:
        measure(cairn, map_path)


if __name__ == '__main__':
    main()
