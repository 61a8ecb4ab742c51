#!/usr/bin/env python3
"""Opens reports in a real browser: report_test.py CAIRN GOLDEN_MAPS MAP SCREENSHOTS MAKE_MAP WALK

Headless Chromium through its driver; no network.  MAP is a compiled map with a self-test, its build folder beside
it.  Screenshots of what was looked at land in SCREENSHOTS; MAKE_MAP makes maps that no survey makes; WALK is a
map of images without poses, some of which are not joined.
"""
import functools
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from write_report import write_report

CAIRN, GOLDEN, MAP, SCREENSHOTS, MAKE_MAP, WALK = sys.argv[1:7]
BUILD = MAP.replace('.cairn', '.build')
CHECK = BUILD + '/check.json'
report = functools.partial(write_report, CAIRN)
LAYERS_OF_EVERY_MAP = ['regions', 'landmarks', 'stations', 'numbers']


class Browser:
    """One page in headless Chromium; fails on anything in the console and on any request but the page's own."""

    def __init__(self, size='1400,1000', phone=False):
        options = Options()
        for argument in ['--headless=new', '--no-sandbox', '--disable-gpu', f'--window-size={size}']:
            options.add_argument(argument)
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL', 'performance': 'ALL'})
        self.driver = webdriver.Chrome(service=Service('/usr/bin/chromedriver'), options=options)
        if phone:
            width, height = map(int, size.split(','))
            self.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
                'width': width, 'height': height, 'deviceScaleFactor': 2, 'mobile': True})

    def open(self, page):
        self.driver.get(pathlib.Path(page).resolve().as_uri())
        for _ in range(300):
            if self.script('return document.documentElement.dataset.ready') == 'yes':
                self.script('document.documentElement.style.scrollBehavior = "auto"')  # or clicks miss what moves
                return
            time.sleep(0.1)
        raise AssertionError(f'{page} is not ready: {self.driver.get_log("browser")}')

    def script(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def shot(self, name):
        os.makedirs(SCREENSHOTS, exist_ok=True)
        self.driver.save_screenshot(os.path.join(SCREENSHOTS, name))

    def text(self, css):
        return self.driver.find_element(By.CSS_SELECTOR, css).text

    def problems(self):
        found = [entry['message'] for entry in self.driver.get_log('browser')]
        for entry in self.driver.get_log('performance'):
            message = json.loads(entry['message'])['message']
            if message['method'] != 'Network.requestWillBeSent':
                continue
            url = message['params']['request']['url']
            if not url.startswith(('file://', 'data:')):
                found.append(f'asked the network for {url}')
        return found

    def canvas_sums(self):
        """A number per drawn layer that changes when what is drawn does."""
        return self.script('''return [...document.querySelectorAll('canvas.leaflet-layer')].map(canvas => {
            const copy = new OffscreenCanvas(canvas.width, canvas.height);
            const context = copy.getContext('2d', {willReadFrequently: true});
            context.drawImage(canvas, 0, 0);
            const data = context.getImageData(0, 0, canvas.width, canvas.height).data;
            let sum = 0;
            for (let i = 0; i < data.length; i += 4) sum += data[i] + 3 * data[i + 1] + 7 * data[i + 2] + data[i + 3];
            return sum;})''')

    def quit(self):
        self.driver.quit()


class ReportTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.browser = Browser()
        cls.page = report(cls.folder.name, MAP)
        cls.browser.open(cls.page)

    @classmethod
    def tearDownClass(cls):
        cls.browser.quit()
        cls.folder.cleanup()

    def setUp(self):
        self.addCleanup(lambda: self.assertEqual(self.browser.problems(), []))

    def click(self, x, y):
        """Clicks at a place of the floor, brought into its middle, in hundredths of a metre."""
        x, y = self.browser.script('''map.panTo(at(arguments[0], arguments[1]), {animate: false});
            const p = map.latLngToContainerPoint(at(arguments[0], arguments[1]));
            document.getElementById('map').scrollIntoView({block: 'center'});
            return [p.x, p.y];''', x, y)
        element = self.browser.driver.find_element(By.ID, 'map')
        size = element.size
        ActionChains(self.browser.driver).move_to_element_with_offset(
            element, round(x - size['width'] / 2), round(y - size['height'] / 2)).click().perform()

    def switch(self, layer, is_on):
        self.browser.script('show(arguments[0], arguments[1])', layer, is_on)

    def test_the_floor_is_drawn_within_a_second_or_so_and_the_head_tells_the_map(self):
        self.assertLess(float(self.browser.script('return document.documentElement.dataset.floorDrawn')), 10000)
        self.assertIn('held-out images localized', self.browser.text('#cards'))
        self.assertRegex(self.browser.text('#cards'), r'\d+ of 6\n')
        self.assertGreater(self.browser.script('return document.querySelectorAll("canvas.leaflet-layer").length'), 2)
        self.browser.shot('floor.png')

    def test_every_layer_can_be_switched_and_draws_something(self):
        boxes = self.browser.driver.find_elements(By.CSS_SELECTOR, '#layers input')
        names = [box.get_attribute('data-layer') for box in boxes]
        for name in LAYERS_OF_EVERY_MAP + ['held-out images', 'self-test errors', 'recall', 'appearance graph', 'entropy', 'region adjacency']:
            self.assertIn(name, names)
        for box in boxes:
            was_on = box.is_selected()
            if was_on:
                box.click()
            off = self.browser.canvas_sums()
            box.click()
            on = self.browser.canvas_sums()
            self.assertEqual(len(on), len(off) + 1, box.get_attribute('data-layer'))
            self.assertGreater(on[-1], 0, box.get_attribute('data-layer'))
            if not was_on:
                box.click()
        for box in boxes:
            if not box.is_selected():
                box.click()
        self.browser.shot('all_layers.png')
        for box, name in zip(boxes, names):
            if box.is_selected() and name not in LAYERS_OF_EVERY_MAP + ['held-out images']:
                box.click()

    def test_a_click_on_a_station_and_on_a_region_explains_them(self):
        self.switch('held-out images', False)
        station = self.browser.script('return R[0].stations[0]')
        self.click(*self.browser.script('return [S.x[arguments[0]], S.y[arguments[0]]]', station))
        text = self.browser.text('#explanation')
        self.assertRegex(text, r'Station \d+')
        self.assertIn('Dropped here', text)
        self.assertIn('features in view', text)
        self.browser.shot('station.png')
        self.browser.driver.find_element(By.CSS_SELECTOR, '#explanation .buttons button').click()
        text = self.browser.text('#explanation')
        self.assertRegex(text, r'Region \d+')
        self.assertIn('common landmarks', text)
        self.assertRegex(text, 'localized|no held-out image')
        self.browser.shot('region.png')
        self.browser.driver.find_element(By.CSS_SELECTOR, '#explanation .close').click()
        self.assertEqual(self.browser.script('return selected.region'), -1)
        self.assertIn('Click a station', self.browser.text('#explanation'))
        self.switch('held-out images', True)

    def test_clicking_again_goes_through_regions_that_overlap(self):
        for layer in ['stations', 'held-out images', 'uncovered']:
            self.switch(layer, False)
        place = self.browser.script('''for (let i = 0; i < numStations; ++i) {
            if (regionsUnder(at(S.x[i], S.y[i])).length > 1) return [S.x[i], S.y[i]];
          }
          return null;''')
        self.assertIsNotNone(place, 'no regions overlap in this map: choose another recipe')
        number = self.browser.script('return regionsUnder(at(arguments[0], arguments[1])).length', *place)
        found = set()
        for _ in range(number):
            self.click(*place)
            found.add(self.browser.script('return selected.region'))
            self.assertIn('Also here', self.browser.text('#explanation'))
            time.sleep(0.5)  # two clicks, not a double click
        self.assertEqual(len(found), number)
        for layer in ['stations', 'held-out images', 'uncovered']:
            self.switch(layer, True)

    def test_a_held_out_image_says_where_it_was_taken_and_how_it_fared(self):
        image = json.loads(pathlib.Path(CHECK).read_text())['images'][0]
        self.assertEqual(self.browser.script('return heldOut.length'), 6)
        self.click(100 * image['true_floor'][0], 100 * image['true_floor'][1])
        text = self.browser.text('#explanation')
        self.assertIn(image['name'], text)
        self.assertIn('taken at', text)
        self.assertIn('error' if 'floor' in image else image['message'].split(',')[0], text)
        self.browser.shot('held_out.png')
        self.assertEqual(self.browser.script('return heldOut.filter(image => isBad(image)).length + document.querySelectorAll("#self-test-text > .scroll:nth-of-type(2) button").length'),
                         2 * self.browser.script('return heldOut.filter(image => isBad(image)).length'))

    def test_a_bar_of_the_recall_chart_opens_its_region(self):
        region = self.browser.script('''const recall = charts.find(one => one.options.onClick);
            const bar = recall.getDatasetMeta(0).data[0], box = recall.canvas.getBoundingClientRect();
            recall.canvas.scrollIntoView({block: 'center'});
            return [recall.data.labels[0], bar.x - box.width / 2, (bar.y + bar.base) / 2 - box.height / 2];''')
        canvas = self.browser.script('return charts.find(one => one.options.onClick).canvas')
        ActionChains(self.browser.driver).move_to_element_with_offset(canvas, round(region[1]), round(region[2])).pause(0.3).click().perform()
        self.assertEqual(str(self.browser.script('return selected.region')), region[0])
        self.assertIn(f'Region {region[0]}', self.browser.text('#explanation'))
        self.browser.script('window.scrollTo(0, 0)')

    def test_hovering_names_what_is_there(self):
        self.switch('held-out images', False)
        place = self.browser.script('return markPlace(0)')
        self.click(*place)
        ActionChains(self.browser.driver).move_by_offset(2, 2).perform()
        self.assertIn('station 0: ', self.browser.text('.leaflet-tooltip'))
        self.switch('held-out images', True)

    def test_terms_are_defined_for_fingers_and_the_keyboard_too(self):
        term = self.browser.driver.find_element(By.CSS_SELECTOR, '#cards dfn')
        term.click()
        self.assertEqual(self.browser.text('#definition'), term.get_attribute('title'))
        self.browser.shot('definition.png')
        ActionChains(self.browser.driver).send_keys(Keys.ESCAPE).perform()
        self.assertFalse(self.browser.driver.find_element(By.ID, 'definition').is_displayed())

    def test_the_keyboard_finds_switches_moves_and_zooms(self):
        query = self.browser.driver.find_element(By.ID, 'query')
        query.clear()
        query.send_keys('station 1', Keys.ENTER)
        self.assertIn('Station 1', self.browser.text('#explanation'))
        query.clear()
        query.send_keys('region 0', Keys.ENTER)
        self.assertIn('Region 0', self.browser.text('#explanation'))
        query.clear()
        query.send_keys('<b>no such place</b>', Keys.ENTER)
        self.assertIn('<b>no such place</b>', self.browser.text('#explanation'))
        box = self.browser.driver.find_element(By.CSS_SELECTOR, '#layers input')
        before = box.is_selected()
        box.send_keys(Keys.SPACE)
        self.assertNotEqual(box.is_selected(), before)
        box.send_keys(Keys.SPACE)
        floor = self.browser.driver.find_element(By.ID, 'map')
        zoom = self.browser.script('return map.getZoom()')
        center = self.browser.script('return map.getCenter().lng')
        floor.send_keys('+')
        floor.send_keys(Keys.ARROW_RIGHT)
        time.sleep(1)
        self.assertGreater(self.browser.script('return map.getZoom()'), zoom)
        self.assertGreater(self.browser.script('return map.getCenter().lng'), center)
        floor.send_keys('-')

    def test_images_that_had_poses_were_not_joined(self):
        for element in ['reconstruction', 'reconstruction-link']:
            self.assertFalse(self.browser.driver.find_element(By.ID, element).is_displayed())

    def test_the_line_the_figures_and_the_advice_are_there(self):
        self.assertIn('group_classes drops', self.browser.text('#stages'))
        self.assertRegex(self.browser.text('#stages'), r'few observations')
        self.assertIn('check_map', self.browser.text('#stages'))  # of the build report beside the map
        self.assertGreaterEqual(self.browser.script('return charts.length'), 4)
        self.assertRegex(self.browser.text('#self-test-text'), r'localized \d of 6')
        self.assertTrue(self.browser.text('#advice'))
        self.assertTrue(self.browser.script('return [...document.querySelectorAll("dfn")].every(node => node.title)'))

    def test_dark_and_light(self):
        ground = 'return getComputedStyle(document.body).backgroundColor'
        light = self.browser.script(ground)
        self.browser.driver.find_element(By.ID, 'theme').click()
        self.assertNotEqual(self.browser.script(ground), light)
        self.browser.shot('dark.png')
        self.browser.driver.find_element(By.ID, 'theme').click()
        self.assertEqual(self.browser.script(ground), light)


class OtherPagesTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def look(self, page, name, size='1400,1000', phone=False):
        browser = Browser(size, phone)
        self.addCleanup(browser.quit)
        browser.open(page)
        browser.shot(name)
        return browser

    def test_a_phone_shows_it_in_one_column(self):
        browser = self.look(report(self.folder.name, MAP), 'phone.png', '400,850', phone=True)
        self.assertEqual(browser.script('return window.innerWidth'), 400)
        self.assertLessEqual(browser.script('return document.documentElement.scrollWidth'), 401)
        browser.script('explainRegion(0)')
        time.sleep(1)
        floor, panel = browser.script('''return ["map", "explanation"].map(id => {
            const box = document.getElementById(id).getBoundingClientRect(); return [box.top, box.bottom]; })''')
        self.assertAlmostEqual(floor[0], 0, delta=2)  # the floor is in view, what is said of it below
        self.assertAlmostEqual(panel[1], 850, delta=2)
        self.assertGreater(panel[0], floor[0] + 300)
        browser.shot('phone_region.png')
        browser.script('document.getElementById("line").scrollIntoView()')
        time.sleep(0.5)
        self.assertFalse(browser.driver.find_element(By.ID, 'explanation').is_displayed())  # it belongs to the floor
        browser.shot('phone_stages.png')
        self.assertEqual(browser.problems(), [])

    def test_another_map_size_is_advice_and_this_map_is_marked_among_them(self):
        for suffix in ['.cairn', '.report.json']:
            shutil.copy(MAP.replace('.cairn', suffix), os.path.join(self.folder.name, 'map' + suffix))
        table = os.path.join(self.folder.name, 'map.pareto.csv')
        pathlib.Path(table).write_text(
            'max_bytes,bytes,landmarks,descriptor_bits,min_common_landmarks,stations_below_k,held_out,localized_ratio,'
            'within_10cm_5deg_ratio,precision_ratio,median_error_m,median_error_deg\n'
            '0,900000,9000,8,90,0,6,1,1,1,0.001,0.02\n20000,19000,90,4,9,0,6,1,1,1,0.002,0.03\n9000,8900,20,2,1,3,6,0,0,1,,\n')
        browser = self.look(report(self.folder.name, os.path.join(self.folder.name, 'map.cairn')), 'sizes.png')
        self.assertIn('max_bytes = 20000', browser.text('#advice'))
        self.assertEqual(browser.script('''return charts.flatMap(one => one.data.datasets).find(set => set.label === 'this map').data[0].x'''),
                         os.path.getsize(MAP))
        self.assertEqual(browser.problems(), [])
        pathlib.Path(table).write_text(pathlib.Path(table).read_text() + '0,inf,90,4,9,0,6,1,1,1,,\n')
        run = subprocess.run([CAIRN, 'report', os.path.join(self.folder.name, 'map.cairn'), '-o', table + '.html'], capture_output=True, text=True)
        self.assertEqual(run.returncode, 4)
        self.assertIn('map.pareto.csv: line 5', run.stderr)

    def test_an_unsealed_map_is_judged_by_the_images_that_are_given(self):
        browser = self.look(report(self.folder.name, BUILD + '/unsealed.cairn', '--check', CHECK), 'unsealed.png')
        self.assertIn('not sealed', browser.text('#cards'))
        self.assertRegex(browser.text('#cards'), r'\d of 6\n')
        self.assertGreater(browser.script('return R.filter(region => region.test).length'), 0)
        self.assertEqual(browser.problems(), [])

    def test_maps_of_only_some_stages(self):
        for name in ['map_2.0.cairn', 'map_2.2.cairn', 'map_2.3.cairn']:
            browser = self.look(report(self.folder.name, os.path.join(GOLDEN, name)), name + '.png')
            self.assertEqual(browser.problems(), [], name)
            self.assertIn('self-test', browser.text('#self-test-text').lower())

    def test_how_the_images_were_joined_is_drawn_and_told(self):
        verdict = json.loads(pathlib.Path(WALK.replace('.cairn', '.build') + '/poses/reconstruction.json').read_text())['verdict']
        browser = self.look(report(self.folder.name, WALK), 'reconstruction.png')
        self.assertEqual(verdict['num_images'], 112)
        self.assertFalse(verdict['is_whole'])
        self.assertIn(f"{verdict['num_joined']} of 112\nimages joined", browser.text('#cards'))
        browser.driver.find_element(By.ID, 'reconstruction-link').click()
        self.assertTrue(browser.driver.find_element(By.ID, 'reconstruction').is_displayed())
        self.assertIn(f"Not whole: {verdict['num_joined']} of 112 images are joined", browser.text('#reconstruction-verdict'))
        tables = browser.text('#reconstruction-text')
        for title in ['Where it is weak', 'loop', 'images missing', verdict['missing'][0]['name']]:
            self.assertIn(title, tables)
        # Every joined image is named by what hovers over the picture, and no name is markup.
        titles = browser.script('return [...document.querySelectorAll("#reconstruction svg title")].map(title => title.textContent)')
        for name in verdict['images']['name']:
            self.assertTrue(any(name in title for title in titles), name)
        self.assertTrue(any('onerror=alert(1)>&"' in title for title in titles))
        self.assertEqual(browser.script('return document.querySelectorAll("img").length'), 0)
        self.assertGreater(sum(title.startswith('missing: ') for title in titles), 0)
        self.assertGreater(browser.driver.find_element(By.CSS_SELECTOR, '#reconstruction svg').size['width'], 600)
        # A long table is opened by its button.
        shown = 'return [...document.querySelectorAll("#reconstruction-text tr")].filter(row => !row.hidden).length'
        before = browser.script(shown)
        buttons = [one for one in browser.driver.find_elements(By.CSS_SELECTOR, '#reconstruction-text button')]
        self.assertGreater(len(buttons), 0)
        for one in buttons:
            browser.script('arguments[0].click()', one)
        self.assertGreater(browser.script(shown), before)
        self.assertEqual(len(browser.driver.find_elements(By.CSS_SELECTOR, '#reconstruction-text button')), 0)
        # On the dark ground text is light and the ground dark, in the picture as around it.
        colours = """const paint = css => getComputedStyle(document.querySelector(`#reconstruction svg ${css}`)).fill;
            return [paint('rect'), paint('text'), getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color];"""
        for _ in range(2):
            ground, ink, page_ground, page_ink = browser.script(colours)
            self.assertEqual((ground, ink), (page_ground, page_ink))
            browser.driver.find_element(By.ID, 'theme').click()
        browser.script('document.getElementById("reconstruction").scrollIntoView()')
        browser.shot('reconstruction_picture.png')
        self.assertEqual(browser.problems(), [])
        phone = self.look(report(self.folder.name, WALK), 'reconstruction_phone.png', '400,850', phone=True)
        self.assertLessEqual(phone.script('return document.documentElement.scrollWidth'), 401)

    def test_names_with_markup_stay_text(self):
        copy = os.path.join(self.folder.name, 'evil.cairn')
        evil = '</script><script>document.title="taken"</script><img src=x onerror=alert(1)>'
        make = subprocess.run([MAKE_MAP, copy, evil], capture_output=True, text=True)
        self.assertEqual(make.returncode, 0, make.stderr)
        browser = self.look(report(self.folder.name, copy), 'markup.png')
        self.assertEqual(browser.driver.title, evil)
        self.assertEqual(browser.text('#name'), evil)
        self.assertEqual(browser.script('return document.querySelectorAll("img").length'), 0)
        browser.script('explainStation(0)')
        self.assertIn('onerror', browser.text('#explanation'))
        self.assertEqual(browser.problems(), [])

    def test_an_empty_map(self):
        copy = os.path.join(self.folder.name, 'empty.cairn')
        subprocess.run([MAKE_MAP, copy], check=True)
        browser = self.look(report(self.folder.name, copy), 'empty.png')
        self.assertEqual(browser.problems(), [])
        self.assertIn('0\nlandmarks', browser.text('#cards'))
        self.assertIn('no self-test', browser.text('#self-test-text'))

    def test_two_maps_on_one_floor(self):
        small = os.path.join(GOLDEN, 'map_2.2.cairn')
        page = report(self.folder.name, os.path.join(GOLDEN, 'map_2.3.cairn'), '--compare', small)
        browser = self.look(page, 'compare.png')
        self.assertIn('map_2.2.cairn', browser.text('#changes'))
        self.assertEqual(browser.problems(), [])

    def test_places_that_changed_are_circles_that_say_what(self):
        path = os.path.join(self.folder.name, 'lattice.cairn')
        subprocess.run([MAKE_MAP, path, '400', '144', '4'], check=True)
        browser = self.look(report(self.folder.name, path), 'changed_places.png')
        self.assertIn('2\nplaces changed', browser.text('#cards'))
        self.assertIn('more gone than new', browser.text('#legend'))
        table = browser.text('#changed-places')
        for text in ['tuesday', 'image0.jpg', 'image1.jpg', '50', '12']:
            self.assertIn(text, table)
        drawn = sum(browser.canvas_sums())
        browser.script('show("changed places", false)')
        self.assertLess(sum(browser.canvas_sums()), drawn)
        browser.script('show("changed places", true)')
        # What lies in a circle is explained with the images that show it, and these lead to their stations.
        self.assertEqual(browser.script('const c = changedPlaces[0]; return changeNear(at(c.x + 0.9 * c.radius, c.y))'), 0)
        self.assertEqual(browser.script('const c = changedPlaces[0]; return changeNear(at(c.x + 1.1 * c.radius, c.y))'), -1)
        browser.driver.find_element(By.CSS_SELECTOR, '#changed-places-text button').click()
        text = browser.text('#explanation')
        self.assertIn('Changed place', text)
        self.assertIn('features gone', text)
        self.assertIn('image0.jpg', text)
        browser.shot('changed_place.png')
        browser.driver.find_element(By.CSS_SELECTOR, '#explanation table button').click()
        self.assertIn('Station 0', browser.text('#explanation'))
        self.assertEqual(browser.problems(), [])
        plain = self.look(report(self.folder.name, os.path.join(GOLDEN, 'map_2.3.cairn')), 'unchanged.png')
        self.assertFalse(plain.driver.find_element(By.ID, 'changed-places').is_displayed())
        self.assertEqual(plain.problems(), [])

    def test_a_drive_is_replayed(self):
        run = {'reached': True, 'start': {'x_m': 1, 'y_m': 0, 'heading_deg': 0},
               'legs': [{'kind': 'explore', 'pose': {'x_m': 3, 'y_m': 0, 'heading_deg': 0},
                         'steps': [{'pose': {'x_m': 1.5, 'y_m': 0, 'heading_deg': 0}},
                                   {'pose': {'x_m': 2, 'y_m': 0.2, 'heading_deg': 10}}]}]}
        path = os.path.join(self.folder.name, 'run.json')
        pathlib.Path(path).write_text(json.dumps(run))
        browser = self.look(report(self.folder.name, os.path.join(GOLDEN, 'map_2.3.cairn'), '--drive', path), 'drive.png')
        self.assertEqual(browser.script('return Number(document.getElementById("time").max)'), 3)
        browser.driver.find_element(By.ID, 'play').click()
        time.sleep(1)
        self.assertIn('3 of 3: explore', browser.text('#moment'))
        self.assertEqual(browser.problems(), [])


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1], verbosity=2)
