#!/usr/bin/env python3
"""What `cairn report` reads, refuses and leaves alone, without a browser: report_inputs_test.py CAIRN MAP

MAP is a compiled map with a self-test, its build folder and build report beside it.
"""
import functools
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from write_report import write_report

CAIRN, MAP = sys.argv[1:3]
BUILD = MAP.replace('.cairn', '.build')
CHECK = BUILD + '/check.json'
report = functools.partial(write_report, CAIRN)


class ReportInputsTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def test_held_out_images_of_another_compilation_are_not_shown(self):
        copy = os.path.join(self.folder.name, 'map.cairn')
        shutil.copy(MAP, copy)
        check = json.loads(pathlib.Path(CHECK).read_text())
        check['num_landmarks'] += 1
        build = pathlib.Path(self.folder.name) / 'map.build'
        build.mkdir()
        (build / 'check.json').write_text(json.dumps(check))
        page = os.path.join(self.folder.name, 'map.html')
        run = subprocess.run([CAIRN, 'report', copy, '-o', page], capture_output=True, text=True)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn('another compilation', run.stderr)
        self.assertNotIn('"held_out_is_self_test"', pathlib.Path(page).read_text())  # stands beside them
        shown = report(self.folder.name, MAP)
        self.assertIn('"held_out_is_self_test"', shown.read_text())

    def test_paper_needs_no_script(self):
        page = report(self.folder.name, MAP, '--print', '--svg', os.path.join(self.folder.name, 'pictures'))
        text = page.read_text()
        self.assertNotIn('<script', text)
        self.assertIn('<svg', text)
        self.assertTrue(os.path.exists(os.path.join(self.folder.name, 'pictures', 'floor.svg')))

    def test_a_map_that_verify_refuses_gets_no_report(self):
        data = bytearray(pathlib.Path(MAP).read_bytes())
        data[len(data) // 2] ^= 1
        broken = os.path.join(self.folder.name, 'broken.cairn')
        pathlib.Path(broken).write_bytes(data)
        page = os.path.join(self.folder.name, 'broken.html')
        run = subprocess.run([CAIRN, 'report', broken, '-o', page], capture_output=True, text=True)
        self.assertEqual(run.returncode, 4)
        self.assertIn('broken.cairn', run.stderr)
        self.assertFalse(os.path.exists(page))

    def test_other_files_are_refused_with_their_names(self):
        path = os.path.join(self.folder.name, 'junk.json')
        pathlib.Path(path).write_text('[1, 2')
        for option in ['--build-report', '--check', '--drive']:
            run = subprocess.run([CAIRN, 'report', MAP, '-o', path + '.html', option, path], capture_output=True, text=True)
            self.assertEqual(run.returncode, 4)
            self.assertRegex(run.stderr, re.escape(path))

    def test_what_is_right_json_but_no_check_or_drive_is_refused(self):
        path = os.path.join(self.folder.name, 'wrong.json')
        wrong = {'--build-report': ['{}', '{"stages": {}}', '{"stages": [null]}', '{"stages": [{}]}', '{"stages": [{"stage": "a", "seconds": "b"}]}',
                                    '{"stages": [{"stage": "a", "out": {"images": null}}]}', '{"stages": [{"stage": "a", "rejected": [{}]}]}',
                                    '{"stages": [{"stage": "a", "rejected": 5}]}'],
                 '--check': ['{"images": {}}', '{"images": [null]}', '{"images": [{"name": 5}]}',
                             '{"images": [{"true_floor": null}]}', '{"images": [{"true_floor": ["a", 1]}]}',
                             '{"images": [{"true_floor": [1, 2], "floor": [1, 2]}]}', '{"images": [{"is_gross_error": 1}]}',
                             '{"images": [{"num_inliers": "7"}]}', '{"images": [{"rejected": 7}]}',
                             '{"images": [{"true_floor": [1e308, 2]}]}', '{"images": [{"true_floor": [1, 2], "floor": [1, 2], "error_m": -1}]}'],
                 '--drive': ['{}', '{"start": {"x_m": 1e300, "y_m": 1}}', '{"start": {"x_m": "a", "y_m": 1}}', '{"start": null}',
                             '{"start": {"x_m": 1, "y_m": 1}, "legs": [null]}',
                             '{"start": {"x_m": 1, "y_m": 1}, "legs": [{"kind": 5}]}',
                             '{"start": {"x_m": 1, "y_m": 1}, "reached": "yes"}',
                             '{"start": {"x_m": 1, "y_m": 1}, "legs": [{"steps": [null]}]}']}
        for option, texts in wrong.items():
            for text in texts:
                pathlib.Path(path).write_text(text)
                run = subprocess.run([CAIRN, 'report', MAP, '-o', path + '.html', option, path], capture_output=True, text=True)
                self.assertEqual(run.returncode, 4, text)
                self.assertIn(path, run.stderr)

    def test_a_build_report_that_is_deep_or_says_more_does_no_harm(self):
        path = os.path.join(self.folder.name, 'deep.json')
        deep = '{"stages": [{"stage": "simulate", "more": ' + 1000000 * '[' + 1000000 * ']' + '}], "more": 1}'
        pathlib.Path(path).write_text(deep)
        page = report(self.folder.name, MAP, '--build-report', path)
        self.assertFalse('[[[[' in page.read_text())

    def test_what_was_not_checked_is_said(self):
        path = os.path.join(self.folder.name, 'none.json')
        pathlib.Path(path).write_text('{}')
        run = subprocess.run([CAIRN, 'report', MAP, '-o', path + '.html', '--check', path], capture_output=True, text=True)
        self.assertEqual(run.returncode, 6)
        self.assertIn('no held-out images', run.stderr)

    def test_what_is_found_beside_the_map_is_not_written_over_nor_is_a_device(self):
        shutil.copy(MAP, os.path.join(self.folder.name, 'map.cairn'))
        shutil.copytree(BUILD, os.path.join(self.folder.name, 'map.build'))
        shutil.copy(MAP.replace('.cairn', '.report.json'), os.path.join(self.folder.name, 'map.report.json'))
        os.mkfifo(os.path.join(self.folder.name, 'pipe'))
        for name, code in [('map.report.json', 2), ('map.build/check.json', 2), ('map.build/classes.db', 2), ('pipe', 7), ('nowhere/a.html', 7)]:
            path = os.path.join(self.folder.name, name)
            before = pathlib.Path(path).read_bytes() if os.path.isfile(path) else None
            run = subprocess.run([CAIRN, 'report', os.path.join(self.folder.name, 'map.cairn'), '-o', path], capture_output=True, text=True)
            self.assertEqual(run.returncode, code, name + run.stderr)
            self.assertIn(name, run.stderr)
            if before is not None:
                self.assertEqual(pathlib.Path(path).read_bytes(), before)
        self.assertTrue(pathlib.Path(self.folder.name, 'pipe').is_fifo())
        run = subprocess.run([CAIRN, 'report', MAP, '-o', self.folder.name + '/floor.svg', '--svg', self.folder.name], capture_output=True, text=True)
        self.assertEqual(run.returncode, 2, run.stderr)
        run = subprocess.run([CAIRN, 'report', MAP, '-o', self.folder.name + '/a.html', '--build-dir', self.folder.name + '/b'], capture_output=True, text=True)
        self.assertEqual(run.returncode, 3, run.stderr)

    def test_no_input_is_written_over(self):
        for name in ['map.cairn', 'check.json']:
            path = os.path.join(self.folder.name, name)
            pathlib.Path(path).write_bytes(pathlib.Path(MAP if name == 'map.cairn' else CHECK).read_bytes())
            before = pathlib.Path(path).read_bytes()
            run = subprocess.run([CAIRN, 'report', os.path.join(self.folder.name, 'map.cairn'), '-o', path, '--check',
                                  os.path.join(self.folder.name, 'check.json') if name == 'check.json' else CHECK],
                                 capture_output=True, text=True)
            self.assertEqual(run.returncode, 2, run.stderr)
            self.assertEqual(pathlib.Path(path).read_bytes(), before)


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1], verbosity=2)
