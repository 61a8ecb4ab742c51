"""The Python module: what it answers, what it refuses and how it says so.

python_test.py POSTER PROGRAM: the folder of make_poster_map, the program `cairn`.
"""
import json
import math
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy

import cairn

POSTER = pathlib.Path(sys.argv[1])
PROGRAM = sys.argv[2]


def read_pgm(path):
    contents = pathlib.Path(path).read_bytes()
    size, rest = contents.split(b"\n255\n", 1)
    width, height = (int(number) for number in size.split()[-2:])
    return numpy.frombuffer(rest, numpy.uint8).reshape(height, width)


class Poster(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = cairn.Map.open(POSTER / "poster.cairn")
        cls.image = read_pgm(POSTER / "poster.pgm")

    def setUp(self):
        self.localizer = cairn.Localizer(self.map)


class Logging(unittest.TestCase):
    """Frames of the drive: 0 and 1 are 10 cm apart, 5 is elsewhere."""
    NAMES = [POSTER / f"{i}.pgm" for i in (0, 1, 5)]

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.map = cairn.Map.open(POSTER / "drive.cairn")

    def contents(self, name):
        """All that a log holds, but for when."""
        folder = self.folder / name
        database = sqlite3.connect(folder / "features.db")
        found = {table: database.execute(f"SELECT * FROM {table} ORDER BY 1").fetchall()
                 for table in ("cameras", "images", "keypoints", "descriptors", "cairn_log_map")}
        found["poses"] = database.execute(
            "SELECT image_id, qw, qx, qy, qz, tx, ty, tz FROM cairn_log_frames ORDER BY 1").fetchall()
        database.close()
        for file in ("images.txt", "cameras.txt", "frame.json"):
            found[file] = (folder / file).read_bytes()
        return found

    def program(self, name, *options):
        subprocess.run([PROGRAM, "localize", POSTER / "drive.cairn", *options, "--log", self.folder / name,
                        *self.NAMES], capture_output=True, check=True)
        return self.contents(name)

    def test_keeps_what_the_program_keeps(self):
        log = cairn.Log(self.map, self.folder / "own")
        localizer = cairn.Localizer(self.map, log=log)
        plain = cairn.Localizer(self.map)
        for name in self.NAMES:
            image = read_pgm(name)
            self.assertEqual(localizer.localize(image).center.tolist(), plain.localize(image).center.tolist())
        self.assertEqual((log.num_kept, log.error), (2, None))
        log.close()
        self.assertEqual(self.contents("own"), self.program("program"))

    def test_of_a_tracker_too(self):
        log = cairn.Log(self.map, self.folder / "own")
        tracker = cairn.Tracker(self.map, log=log)
        for name in self.NAMES:
            self.assertTrue(tracker.track(read_pgm(name)))
        self.assertEqual(log.num_kept, 2)
        log.close()
        self.assertEqual(self.contents("own"), self.program("program", "--sequence"))

    def test_one_writes_a_folder_and_it_is_of_one_map(self):
        log = cairn.Log(self.map, self.folder / "own")
        with self.assertRaises(cairn.Error) as busy:
            cairn.Log(self.map, self.folder / "own")
        self.assertEqual(busy.exception.name, "busy")
        other = cairn.Map.open(POSTER / "poster.cairn")
        with self.assertRaises(cairn.Error) as of_other:
            cairn.Localizer(other, log=log)
        self.assertEqual(of_other.exception.name, "invalid_argument")
        log.close()
        log.close()
        with self.assertRaises(cairn.Error):
            cairn.Log(other, self.folder / "own")
        self.assertEqual(cairn.Log(self.map, self.folder / "own").num_kept, 0)
        with self.assertRaises(cairn.Error):
            cairn.Log(self.map, self.folder / "second", max_mb_per_day=0)
        self.assertTrue(cairn.Localizer(self.map, log=log).localize(read_pgm(self.NAMES[0])))
        for wrong in (lambda: cairn.Log.__new__(cairn.Log).close(), lambda: cairn.Localizer(self.map, log=3),
                      lambda: cairn.Log(self.map, "")):
            with self.assertRaises((TypeError, ValueError)):
                wrong()


class Site(unittest.TestCase):
    """An atlas of the poster's map and of that of the wings, made by the program."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.path = cls.folder / "site.atlas"
        printed = subprocess.run([PROGRAM, "atlas", POSTER / "poster.cairn", POSTER / "wings.cairn", "-o", cls.path, "--epoch", "3"],
                                 capture_output=True, check=True, text=True).stdout
        assert printed.startswith("atlas site: 2 maps"), printed
        cls.atlas = cairn.Atlas.open(cls.path)
        cls.names = [POSTER / "poster.pgm", *(POSTER / f"wing{i}.pgm" for i in range(7))]

    def program(self, *arguments):
        return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)

    def test_answers_are_the_programs(self):
        localizer = cairn.AtlasLocalizer(self.atlas)
        lines = self.program("localize", self.path, *self.names).stdout.splitlines()
        self.assertEqual(len(lines), len(self.names))
        places = {}
        for line, name in zip(lines, self.names):
            expected = json.loads(line)
            answer = localizer.localize(read_pgm(name))
            self.assertEqual(bool(answer), expected["fix"])
            self.assertEqual(answer.elsewhere, expected["elsewhere"])
            self.assertEqual([self.atlas.map_names[map] for map in answer.maps_tried], expected["maps_tried"])
            self.assertEqual([self.atlas.map_names[place.map] for place in answer.places],
                             [place["map"] for place in [expected, *expected["other_places"]] if "map" in place])
            if not answer.places:
                self.assertEqual(answer.failure.reason, expected["reason"])
                continue
            self.assertEqual(answer.places[0].probability, expected["probability"])
            places[name.stem] = {self.atlas.map_names[place.map]: place.probability for place in answer.places}
            if expected["fix"]:
                self.assertEqual(answer.places[0].fix.center.tolist(), expected["center_m"])
        # The poster is the first place of both wings, too.
        self.assertAlmostEqual(places["poster"]["poster"], 0.5, delta=0.01)
        self.assertAlmostEqual(places["poster"]["wings"], 0.5, delta=0.01)
        for name in "wing2", "wing4", "wing5", "wing6":
            self.assertEqual(list(places[name]), ["wings"])
            self.assertGreater(places[name]["wings"], 0.99)

    def test_gives_the_map_in_which_the_robot_is(self):
        self.assertEqual(len(self.atlas), 2)
        self.assertEqual(self.atlas.find_map("wings"), 1)
        self.assertEqual(self.atlas.open_map(1).name, "wings")
        for wrong, kind in ((lambda: self.atlas.open_map(2), IndexError), (lambda: self.atlas.open_map(-1), IndexError),
                            (lambda: self.atlas.find_map("none"), cairn.Error),
                            (lambda: cairn.AtlasLocalizer(self.atlas, max_num_maps=0), cairn.Error),
                            (lambda: cairn.Atlas.__new__(cairn.Atlas).find_map("wings"), TypeError)):
            with self.assertRaises(kind):
                wrong()

    def test_is_the_atlas_that_was_asked_for(self):
        self.assertEqual(len(cairn.Atlas.open(self.path, name="site", min_epoch=3)), 2)
        for options, name in (({"min_epoch": 4}, "not_newer"), ({"name": "other"}, "other_map"),
                              ({"public_key": bytes(32)}, "not_signed")):
            with self.assertRaises(cairn.Error) as caught:
                cairn.Atlas.open(self.path, **options)
            self.assertEqual(caught.exception.name, name)

    def test_signed_atlases_are_verified_with_their_maps(self):
        key, copy, path = self.folder / "fleet.key", self.folder / "poster.cairn", self.folder / "signed.atlas"
        shutil.copy(POSTER / "poster.cairn", copy)
        self.assertEqual(self.program("keygen", key).returncode, 0)
        self.assertEqual(self.program("atlas", copy, POSTER / "wings.cairn", "-o", path, "--key", key).returncode, 0)
        whole = self.program("verify", path, "--public-key", f"{key}.pub")
        self.assertEqual(whole.returncode, 0, whole.stderr)
        self.assertIn("its 2 maps are the files", whole.stdout)
        public_key = bytes.fromhex(pathlib.Path(f"{key}.pub").read_text().split()[-1])
        self.assertEqual(len(cairn.Atlas.open(path, public_key=public_key)), 2)
        self.assertEqual(self.program("verify", self.path, "--public-key", f"{key}.pub").returncode, 17)  # not signed
        shutil.copy(POSTER / "drive.cairn", copy)
        exchanged = self.program("verify", path)
        self.assertEqual(exchanged.returncode, 23)
        self.assertIn("make the atlas anew", exchanged.stderr)

    def test_ways_lead_through_passages(self):
        passages = self.folder / "passages.csv"
        passages.write_text("# NAME, MAP/IMAGE, MAP/IMAGE[, COST]\n\nlift, wings/h0, wings/a0, 0.5\n")
        path = self.folder / "lift.atlas"
        made = self.program("atlas", POSTER / "poster.cairn", POSTER / "wings.cairn", "-o", path, "--passages", passages)
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertIn("lift leads from wings to wings, cost 0.5", made.stdout)
        way = json.loads(self.program("route", path, "wings/h0", "wings/a1", "--json").stdout)
        self.assertEqual([(leg["images"], leg.get("passage")) for leg in way["legs"]], [(["h0"], "lift"), (["a0", "a1"], None)])
        for wrong, sentence in (("lift, wings/h0", "is no passage"), ("lift, wings/h0, hall/a0", "of none of the maps"),
                                ("lift, wings/h0, wings/none", "no survey image 'none'"), ("lift, wings/h0, wings/a0, -1", "no cost"),
                                ("lift, wings/h0, wings/a0, nan", "no cost")):
            passages.write_text("\n" + wrong + "\n")
            refused = self.program("atlas", POSTER / "wings.cairn", "-o", path, "--passages", passages)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("passages.csv:2: ", refused.stderr)
            self.assertIn(sentence, refused.stderr)

    def test_what_an_atlas_cannot_do_is_said(self):
        image = self.names[0]
        for arguments, sentence in ((("localize", self.path, image, "--sequence"), "one map"), (("localize", self.path, image, "-o", "p.txt"), "frame of its own"),
                                    (("localize", self.path, image, "--estimator", "both"), "one by one"),
                                    (("localize", POSTER / "poster.cairn", image, "--max-num-maps", "2"), "atlas of several maps"),
                                    (("inspect", self.path, "--at", "0,0"), "only --json"),
                                    (("route", self.path, "h0", "h1"), "MAP/IMAGE"),
                                    (("atlas", POSTER / "poster.cairn", POSTER / "poster.cairn", "-o", self.folder / "x.atlas"), "called 'poster'"),
                                    (("atlas", image, "-o", self.folder / "x.atlas"), "not a SQLite database"),
                                    (("atlas", POSTER / "poster.cairn", "-o", POSTER / "poster.cairn"), "poster.cairn")):
            refused = self.program(*arguments)
            self.assertNotEqual(refused.returncode, 0, arguments)
            self.assertIn(sentence, refused.stderr)
        self.assertFalse((self.folder / "x.atlas").exists())

    def test_any_number_of_threads_gives_the_same_bytes(self):
        written = []
        for threads in "1", "2":
            path = self.folder / threads / "same.atlas"
            path.parent.mkdir()
            subprocess.run([PROGRAM, "atlas", POSTER / "wings.cairn", POSTER / "poster.cairn", "-o", path, "--threads", threads],
                           capture_output=True, check=True)
            written.append(path.read_bytes())
        self.assertEqual(*written)


class Starting(unittest.TestCase):
    """The wings of tests/install/poster_wings.h: a0 to a3 are places 0 to 3, b0 to b3 4 to 7, h0 to h2 8 to 10."""

    @classmethod
    def setUpClass(cls):
        cls.map = cairn.Map.open(POSTER / "wings.cairn")
        cls.model = cairn.PlaceModel(cls.map)
        cls.pictures = [read_pgm(POSTER / f"wing{i}.pgm") for i in range(7)]  # b0 to b3, h0 to h2

    def route(self, *arguments):
        printed = subprocess.run([PROGRAM, "route", POSTER / "wings.cairn", *arguments[:2], "--json", *arguments[2:]],
                                 capture_output=True, check=True, text=True).stdout
        return json.loads(printed)

    def test_routes_are_the_programs(self):
        for weight in "links", "matches", "entropy", "risk":
            for start, goal in ("h0", "h2"), ("a0", "h1"), ("b2", "a1"):
                expected = self.route(start, goal, "--weight", weight)
                route = self.map.route(self.map.find_image(start), self.map.find_image(goal), weight)
                self.assertEqual([self.map.image_name(image) for image in route.images],
                                 [image["name"] for image in expected["images"]])
                self.assertEqual((route.num_links, route.cost), (expected["num_links"], expected["cost"]))
        self.assertEqual(self.map.route(8, 10).images, [8, 10])
        self.assertEqual(self.map.route(8, 10, "matches").images, [8, 9, 10])

    def test_beliefs_are_the_programs(self):
        names = [POSTER / f"wing{i}.pgm" for i in (0, 1, 2, 4, 5)]
        printed = subprocess.run([PROGRAM, "where", POSTER / "wings.cairn", *names, "--json", "--places", "4"],
                                 capture_output=True, check=True, text=True).stdout
        belief = cairn.PlaceBelief(self.map)
        self.assertEqual(belief.elsewhere, 0.5)
        for line, name in zip(printed.splitlines(), names):
            expected = json.loads(line)
            fix = belief.see(read_pgm(name))
            self.assertEqual(bool(fix), expected["fix"])
            self.assertEqual([(self.map.image_name(image), probability) for image, probability in belief.places(4)],
                             [(place["image"], place["probability"]) for place in expected["places"]])
            self.assertEqual(belief.elsewhere, expected["elsewhere"])
        self.assertEqual(belief.places(0), [])
        belief.move(0.5, 0, 0.1)
        belief.elapse(0.5)
        belief.sense_up((0, -1, 0.1), 2)
        self.assertEqual(cairn.PlaceBelief(self.map, elsewhere_ratio=0.25).elsewhere, 0.25)
        for wrong in (lambda: cairn.PlaceBelief(self.map, elsewhere_ratio=2), lambda: belief.move(float("nan"), 0, 0),
                      lambda: belief.elapse(-1), lambda: belief.sense_up((0, 0, 0), 2), lambda: belief.sense_up((0, -1, 0), 0),
                      lambda: cairn.PlaceBelief(self.map, elsewhere=0.1)):
            with self.assertRaises((cairn.Error, ValueError)):
                wrong()
        with self.assertRaises(ValueError):
            belief.places(-1)
        with self.assertRaises(TypeError):
            cairn.PlaceBelief.__new__(cairn.PlaceBelief).see(self.pictures[0])

    def test_survey_images_have_poses(self):
        pose = self.map.image_pose(self.map.find_image("b2"))
        self.assertEqual(pose.shape, (4, 4))
        numpy.testing.assert_allclose(-pose[:3, :3].T @ pose[:3, 3], [0, 60.3, 1.5], atol=1e-6)

    def test_twins_are_told_apart_where_they_differ(self):
        looks = [self.model.look(picture) for picture in self.pictures]
        starts = cairn.StartHypotheses(self.model, looks[0], 9)
        self.assertEqual([start.posterior for start in starts.hypotheses], [0.5, 0.5])
        self.assertEqual(sorted(start.start for start in starts.hypotheses), [0, 4])
        self.assertEqual(starts.hypotheses[starts.followed].way, [0, 1, 2, 3, 8, 9])
        self.assertEqual([starts.observe(look) for look in looks[1:3]], ["follow", "switch"])
        followed = starts.hypotheses[starts.followed]
        self.assertEqual((followed.start, followed.way), (4, [4, 5, 6, 7, 8, 9]))
        self.assertGreater(followed.posterior, 0.9)
        self.assertGreater(followed.way_cost, 0)
        self.assertEqual(starts.num_images, 2)
        self.assertEqual(starts.whereabouts(starts.followed), 6)
        self.assertEqual(starts.replan(starts.followed), [6, 7, 8, 9])
        starts.restart()
        self.assertEqual(starts.num_images, 0)
        self.assertEqual(starts.whereabouts(starts.followed), 4)
        self.assertEqual(starts.observe(looks[6]), "lost")  # h2, right after b0
        self.assertTrue(starts.refute())
        self.assertEqual(starts.hypotheses[starts.followed].start, 0)
        self.assertFalse(starts.refute())

    def test_looks_and_expectations_are_one_number_for_each_place(self):
        look = self.model.look(self.pictures[2])
        self.assertEqual(self.model.num_places, 11)
        self.assertEqual((look.scores.shape, look.probabilities.dtype), ((11,), numpy.float64))
        self.assertEqual(look.probabilities.argmax(), 6)
        self.assertAlmostEqual(look.probabilities.sum(), 1)
        self.assertEqual(self.model.expected(6).argmax(), 6)
        self.assertEqual(self.model.look_closer(self.pictures[2]).scores.argmax(), 6)
        self.assertEqual((self.model.place_of_image(6), self.model.images_of_place(6)), (6, [6]))
        nothing = self.model.look_at_features(numpy.zeros((0, 128), numpy.uint8))
        self.assertEqual(set(nothing.scores), {0})
        sharp = cairn.PlaceModel(self.map, score_exponent=20).look(self.pictures[2])
        self.assertEqual(sharp.scores.tolist(), look.scores.tolist())
        self.assertGreater(sharp.probabilities[6], look.probabilities[6])

    def test_scores_of_a_callers_own(self):
        scores = numpy.zeros(11)
        scores[[2, 6]] = 1, 0.9
        starts = cairn.StartHypotheses(self.model, cairn.PlaceScores(scores, scores / scores.sum()), 9)
        self.assertEqual([start.start for start in starts.hypotheses], [2, 6])
        only = cairn.StartHypotheses(self.model, cairn.PlaceScores(scores, scores / scores.sum()), 9, min_score_ratio=0.95)
        self.assertEqual([start.start for start in only.hypotheses], [2])
        for wrong in (scores[:3], -scores, scores * numpy.nan):
            with self.assertRaises((cairn.Error, ValueError)):
                cairn.StartHypotheses(self.model, cairn.PlaceScores(wrong, wrong), 9)
        short = cairn.PlaceScores(numpy.array([1.0]), numpy.array([1.0]))
        with self.assertRaisesRegex(cairn.Error, "1 scores for 11 places"):
            starts.observe(short)
        with self.assertRaisesRegex(ValueError, "dimensions"):
            cairn.PlaceScores(numpy.ones((2, 2)), scores)
        with self.assertRaisesRegex(ValueError, "empty"):
            cairn.PlaceScores(scores, [])

    def test_what_cannot_be_is_refused(self):
        model, first = self.model, self.model.look(self.pictures[0])
        starts = cairn.StartHypotheses(model, first, 9)
        for code, wrong in (("not_found", lambda: cairn.PlaceModel(cairn.Map.open(POSTER / "poster.cairn"))),
                            ("not_found", lambda: self.map.find_image("c0")),
                            ("invalid_argument", lambda: self.map.image_name(11)),
                            ("invalid_argument", lambda: self.map.image_pose(-1)),
                            ("invalid_argument", lambda: self.map.route(0, 11)),
                            ("invalid_argument", lambda: self.map.route(0, 9, "metres")),
                            ("invalid_argument", lambda: cairn.StartHypotheses(model, first, 11)),
                            ("invalid_argument", lambda: cairn.StartHypotheses(model, first, 9, min_score=1)),
                            ("invalid_argument", lambda: cairn.PlaceModel(self.map, keypoint_sigma_px=1)),
                            ("no_data", lambda: cairn.StartHypotheses(
                                model, model.look_at_features(numpy.zeros((0, 128), numpy.uint8)), 9))):
            with self.assertRaises(cairn.Error) as caught:
                wrong()
            self.assertEqual(caught.exception.name, code)
        for error, wrong in ((IndexError, lambda: model.images_of_place(11)), (IndexError, lambda: model.expected(-1)),
                             (IndexError, lambda: model.place_of_image(11)), (IndexError, lambda: starts.whereabouts(2)),
                             (IndexError, lambda: starts.replan(-1)), (TypeError, lambda: model.look([[1, 2]])),
                             (TypeError, lambda: model.look(self.pictures[0].astype(float))),
                             (TypeError, lambda: model.look_at_features(numpy.zeros((1, 128)))),
                             (ValueError, lambda: model.look_at_features(numpy.zeros((1, 127), numpy.uint8))),
                             (TypeError, lambda: starts.observe(first.scores))):
            with self.assertRaises(error):
                wrong()

    def test_threads_share_a_model_and_starts_outlive_it(self):
        model = cairn.PlaceModel(self.map)
        expected = model.look(self.pictures[1]).scores.tolist()
        found = []
        threads = [threading.Thread(target=lambda: found.append(model.look(self.pictures[1]).scores.tolist()))
                   for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, [expected] * 4)
        starts = cairn.StartHypotheses(model, model.look(self.pictures[0]), 9)
        look = model.look(self.pictures[1])
        del model
        self.assertEqual(starts.observe(look), "follow")

    def test_objects_that_no_constructor_has_made(self):
        look = self.model.look(self.pictures[0])
        starts = cairn.StartHypotheses(self.model, look, 9)
        for example in self.map.route(8, 10), look, self.model, starts.hypotheses[0], starts:
            kind = type(example)
            empty = kind.__new__(kind)
            for name, value in vars(kind).items():
                if isinstance(value, property):
                    with self.assertRaises(TypeError):
                        getattr(empty, name)
            with self.assertRaises(TypeError):
                cairn.StartHypotheses(self.model, empty, 9)


class Localizing(Poster):
    def test_gives_the_programs_pose_bit_for_bit(self):
        printed = subprocess.run([PROGRAM, "localize", POSTER / "poster.cairn", POSTER / "poster.pgm"],
                                 capture_output=True, check=True, text=True).stdout
        expected = json.loads(printed)
        fix = self.localizer.localize(self.image)
        self.assertTrue(fix)
        self.assertEqual(fix.rotation_wxyz.tolist(), expected["rotation_wxyz"])
        self.assertEqual(fix.translation.tolist(), expected["translation_m"])
        self.assertEqual(fix.center.tolist(), expected["center_m"])
        self.assertEqual(fix.covariance.T.ravel().tolist(), expected["covariance"])
        self.assertEqual(fix.num_inliers, expected["num_inliers"])
        self.assertEqual(fix.candidates, expected["candidates"])
        self.assertEqual(fix.scope, expected["scope"])

    def test_features_give_the_fix_of_their_image(self):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(POSTER / "poster.pgm", folder)
            subprocess.run([PROGRAM, "stage", "extract-features", folder, "-o", f"{folder}/f.db"], capture_output=True, check=True)
            database = sqlite3.connect(f"{folder}/f.db")
            (keypoints,), (descriptors,) = (database.execute(f"SELECT data FROM {table}").fetchone() for table in ("keypoints", "descriptors"))
            database.close()
        keypoints = numpy.frombuffer(keypoints, numpy.float32).reshape(-1, 4)
        descriptors = numpy.frombuffer(descriptors, numpy.uint8).reshape(-1, 128)
        camera = self.map.camera_for_size(320, 240)
        self.assertEqual(self.map.descriptors, "sift")
        fix = self.localizer.localize_features(keypoints, descriptors, camera)
        self.assertEqual(fix.center.tolist(), self.localizer.localize(self.image).center.tolist())
        self.assertTrue(self.localizer.localize_features(keypoints[:, :2].astype(float), descriptors[:, :], camera))
        self.assertFalse(self.localizer.localize_features(keypoints[:0], descriptors[:0], camera))
        for wrong in ((keypoints, descriptors[:, :64]), (keypoints, descriptors.astype(numpy.float32)), (keypoints[:5], descriptors),
                      (keypoints[:, :1], descriptors), (keypoints.ravel(), descriptors), (keypoints.astype(int), descriptors),
                      (keypoints * numpy.nan, descriptors), (keypoints, descriptors.astype(int))):
            with self.assertRaises((TypeError, ValueError, cairn.Error)):
                self.localizer.localize_features(*wrong, camera)

    def test_pose_is_where_the_picture_was_taken(self):
        fix = self.localizer.localize(self.image)
        numpy.testing.assert_allclose(fix.center, [0.4, 0.1, 1.6], atol=0.05)
        self.assertEqual(fix.reason, "none")
        self.assertEqual(fix.covariance.shape, (6, 6))
        matrix = fix.cam_from_world
        numpy.testing.assert_allclose(matrix @ [*fix.center, 1], [0, 0, 0, 1], atol=1e-12)
        self.assertIn("inliers", repr(fix))

    def test_rows_may_have_gaps_and_arrays_may_be_read_only(self):
        wide = numpy.zeros((240, 512), numpy.uint8)
        wide[:, 100:420] = self.image
        view = wide[:, 100:420]
        view.flags.writeable = False
        expected = self.localizer.localize(self.image)
        self.assertEqual(self.localizer.localize(view).translation.tolist(), expected.translation.tolist())
        upper = self.localizer.localize(self.image, camera=self.map.camera_for_size(320, 240))
        self.assertEqual(upper.translation.tolist(), expected.translation.tolist())

    def test_image_of_nothing_has_a_reason_and_no_pose(self):
        fix = self.localizer.localize(numpy.full((240, 320), 90, numpy.uint8))
        self.assertFalse(fix)
        self.assertEqual(fix.reason, "too_few_features")
        self.assertIsNone(fix.center)
        self.assertIsNone(fix.covariance)
        self.assertIn("30", fix.message)

    def test_prior_and_options_reach_the_localizer(self):
        fix = self.localizer.localize(self.image)
        prior = cairn.Prior(fix.rotation_wxyz, fix.translation, sigma_m=0.5)
        self.assertTrue(self.localizer.localize(self.image, prior=prior))
        self.assertFalse(cairn.Localizer(self.map, min_num_inliers=100000).localize(self.image))
        self.assertTrue(cairn.Localizer(self.map, exclude_look_alikes=False).localize(self.image))

    def test_gravity_is_what_the_program_makes_of_it(self):
        with tempfile.TemporaryDirectory() as folder:
            gravity = pathlib.Path(folder) / "gravity.txt"
            gravity.write_text("# right, down, ahead\n0.01 -2 0.02\n1 -1 0\n")
            printed = subprocess.run([PROGRAM, "localize", POSTER / "poster.cairn", POSTER / "poster.pgm", POSTER / "poster.pgm",
                                      "--gravity", gravity, "--gravity-sigma-deg", "1.5"], capture_output=True, check=True, text=True).stdout
        right, tilted = [json.loads(line) for line in printed.splitlines()]
        up = cairn.Up((0.01, -2, 0.02), 1.5)
        self.assertEqual(self.localizer.localize(self.image, up=up).translation.tolist(), right["translation_m"])
        self.assertEqual((up.direction.tolist(), up.sigma_deg, cairn.Up((0, -1, 0)).sigma_deg), ([0.01, -2, 0.02], 1.5, 1))
        self.assertIn("1.5", repr(up))
        fix = self.localizer.localize(self.image, up=cairn.Up([1, -1, 0], sigma_deg=1.5))
        self.assertFalse(fix)
        self.assertEqual(fix.reason, tilted["reason"])
        for direction, sigma_deg in (((0, 0, 0), 1), ((0, 1), 1), ((0, math.nan, 1), 1), ((0, -1, 0), 0), ((0, -1, 0), -1)):
            with self.assertRaises(ValueError):
                cairn.Up(direction, sigma_deg)

    def test_a_rigs_pose_is_the_programs(self):
        """Pictures of the drive, as of two cameras 10 cm apart."""
        drive = cairn.Map.open(POSTER / "drive.cairn")
        localizer = cairn.Localizer(drive)
        pictures = [read_pgm(POSTER / f"{i}.pgm") for i in (0, 1)]
        fixes = [localizer.localize(picture) for picture in pictures]
        cam1_from_cam0 = fixes[1].cam_from_world @ numpy.linalg.inv(fixes[0].cam_from_world)
        rotation = [1, 0, 0, 0]  # the drive does not turn
        translation = [round(number, 3) for number in cam1_from_cam0[:3, 3].tolist()]
        images = [cairn.RigImage(pictures[0]), cairn.RigImage(pictures[1], rotation, translation, drive.camera_for_size(320, 240))]
        found = localizer.localize_rig(images)
        self.assertTrue(found, found.message)
        numpy.testing.assert_allclose(found.center, fixes[0].center, atol=0.05)
        self.assertGreater(found.num_inliers, fixes[0].num_inliers)
        self.assertTrue(localizer.localize_rig(images, cairn.Prior(found.rotation_wxyz, found.translation), cairn.Up((0, -1, 0))))
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for camera, i in (("left", 0), ("right", 1)):
                (folder / camera).mkdir()
                shutil.copy(POSTER / f"{i}.pgm", folder / camera / "a.pgm")
            (folder / "rig.json").write_text(json.dumps([{"cameras": [
                {"image_prefix": "left/", "ref_sensor": True},
                {"image_prefix": "right/", "cam_from_rig_rotation": rotation, "cam_from_rig_translation": translation}]}]))
            localize = [PROGRAM, "localize", POSTER / "drive.cairn", "--rig", folder / "rig.json"]
            printed = json.loads(subprocess.run([*localize, folder / "left" / "a.pgm"], capture_output=True, check=True, text=True).stdout)
            self.assertEqual(found.translation.tolist(), printed["translation_m"])
            self.assertEqual(found.covariance.T.ravel().tolist(), printed["covariance"])
            # What does not go together, or is not there, is said.
            for options, words in (([folder / "right" / "a.pgm"], "left/"), (["--sequence", folder / "left" / "a.pgm"], "follows one camera"),
                                   (["--log", folder / "log", folder / "left" / "a.pgm"], "--log"),
                                   (["--camera", "PINHOLE,320,240,280,280,160,120", folder / "left" / "a.pgm"], "--camera"),
                                   (["--gravity-sigma-deg", "1", folder / "left" / "a.pgm"], "give that"),
                                   (["--max-up-sigmas", "3", folder / "left" / "a.pgm"], "give --gravity"),
                                   (["--gravity", folder / "none.txt", folder / "left" / "a.pgm"], "none.txt")):
                run = subprocess.run([*localize, *options], capture_output=True, text=True)
                self.assertNotEqual(run.returncode, 0, options)
                self.assertIn(words, run.stderr + run.stdout)
            # A line that is no direction is its image's error alone.
            (folder / "up.txt").write_text("0 0 0\n0 -1 0\n")
            run = subprocess.run([*localize, folder / "left" / "a.pgm", folder / "left" / "a.pgm", "--gravity", folder / "up.txt"],
                                 capture_output=True, text=True)
            self.assertNotEqual(run.returncode, 0)
            bad, good = [json.loads(line) for line in run.stdout.splitlines()]
            self.assertIn("no direction", json.dumps(bad))
            self.assertTrue(good["fix"])
            (folder / "right" / "a.pgm").unlink()
            run = subprocess.run([*localize, folder / "left" / "a.pgm"], capture_output=True, text=True)
            self.assertNotEqual(run.returncode, 0)
            self.assertIn("right/a.pgm", run.stderr)
        self.assertEqual(images[1].translation.tolist(), translation)
        self.assertEqual(images[1].rotation_wxyz.tolist(), rotation)
        self.assertEqual((images[0].camera, images[1].camera.width), (None, 320))
        self.assertIs(images[0].image, pictures[0])
        self.assertIn("320 x 240", repr(images[0]))
        with self.assertRaises(cairn.Error):
            localizer.localize_rig([])
        with self.assertRaises(TypeError):
            cairn.RigImage(pictures[0].astype(float))
        with self.assertRaises(ValueError):
            cairn.RigImage(pictures[0], (1, 1, 0, 0))
        with self.assertRaises(ValueError):
            cairn.RigImage(pictures[0], translation=(0, 0, math.inf))

    def test_threads_run_side_by_side_and_one_localizer_is_for_one(self):
        # Another thread runs Python while this one localizes: the interpreter's lock is free.
        ticks, done = [0], threading.Event()

        def tick():
            while not done.is_set():
                ticks[0] += 1
        ticker = threading.Thread(target=tick)
        ticker.start()
        before = ticks[0]
        self.localizer.localize(self.image)
        during = ticks[0] - before
        done.set()
        ticker.join()
        self.assertGreater(during, 100)

        codes = []

        def localize():
            for _ in range(10):
                try:
                    codes.append(0 if self.localizer.localize(self.image) else -1)
                except cairn.Error as error:
                    codes.append(error.code)
        threads = [threading.Thread(target=localize) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(set(codes), {0, 9})  # fixes, and busy


class Steering(unittest.TestCase):
    """On the way to r2 of tests/install/poster_room.h; tests/install/check_steering.sh compares commands with C's and C++'s."""

    @classmethod
    def setUpClass(cls):
        cls.map = cairn.Map.open(POSTER / "room.cairn")
        cls.target = cls.map.find_image("r2")
        *cls.pictures, cls.there = [read_pgm(POSTER / f"room{i}.pgm") for i in (0, 4, 8, 10, 16)]

    def test_comes_nearer_and_arrives(self):
        servo = cairn.Servo(self.map, self.target)
        self.assertEqual(servo.step_s, 0.25)
        for picture in self.pictures:
            command = servo.step(picture)
            self.assertEqual(command.state, "approaching")
            self.assertGreater(command.speed_m_s, 0)
            self.assertGreaterEqual(command.num_matches, command.num_inliers)
            self.assertGreater(command.num_inliers, 12)
        self.assertIn("comes in", command.why)
        lost = servo.step(numpy.full_like(self.there, 90))
        self.assertEqual((lost.state, lost.speed_m_s, lost.turn_rad_s, lost.num_inliers), ("lost", 0, 0, 0))
        there = servo.step(self.there)
        self.assertEqual((there.state, there.speed_m_s), ("arrived", 0))

    def test_goes_the_other_way_where_something_stands_in_it(self):
        servo = cairn.Servo(self.map, self.target)
        servo.blocked()  # nothing was commanded
        self.assertGreater(servo.step(self.pictures[0]).speed_m_s, 0)
        servo.blocked()
        self.assertIn("retreats", servo.step(self.pictures[0]).why)

    def test_options_reach_the_servo(self):
        slow = cairn.Servo(self.map, self.target, max_speed_m_s=0.1, step_s=0.5, max_num_features=50)
        command = slow.step(self.pictures[0])
        self.assertLessEqual(command.speed_m_s, 0.1)
        self.assertLessEqual(command.num_matches, 50)
        self.assertEqual(slow.step_s, 0.5)
        self.assertEqual(cairn.Servo(self.map, self.target, min_num_inliers=1000).step(self.pictures[0]).state, "lost")

    def test_what_cannot_be_is_refused_and_changes_nothing(self):
        servo, expected = cairn.Servo(self.map, self.target), cairn.Servo(self.map, self.target)
        for name, wrong in (("invalid_argument", lambda: cairn.Servo(self.map, 4)),
                            ("invalid_argument", lambda: cairn.Servo(self.map, -1)),
                            ("invalid_argument", lambda: cairn.Servo(self.map, 0, max_speed_m_s=float("nan"))),
                            ("invalid_argument", lambda: cairn.Servo(self.map, 0, score_exponent=1)),
                            ("not_found", lambda: servo.step(self.there[:100])),
                            ("invalid_argument", lambda: servo.step(self.there, cairn.Camera("SIMPLE_PINHOLE", 32, 24, [28, 16, 12])))):
            with self.assertRaises(cairn.Error) as caught:
                wrong()
            self.assertEqual(caught.exception.name, name)
        for error, wrong in ((TypeError, lambda: servo.step(self.there.astype(float))), (TypeError, lambda: servo.step([[1]])),
                             (TypeError, lambda: cairn.Servo(self.map)), (ValueError, lambda: servo.step(self.there[0])),
                             (TypeError, lambda: cairn.Servo.__new__(cairn.Servo).step(self.there)),
                             (TypeError, lambda: cairn.ServoCommand.__new__(cairn.ServoCommand).why)):
            with self.assertRaises(error):
                wrong()
        for picture in self.pictures[:2]:
            found, wanted = servo.step(picture), expected.step(picture)
            self.assertEqual((found.speed_m_s, found.turn_rad_s), (wanted.speed_m_s, wanted.turn_rad_s))
        with self.assertRaisesRegex(cairn.Error, "another camera than before"):
            servo.step(self.there, cairn.Camera("SIMPLE_PINHOLE", 320, 240, [300, 160, 120]))


class Following(unittest.TestCase):
    """The drive of make_poster_map: five frames ahead, then carried away, where it stands."""

    CARRIED = 5

    @classmethod
    def setUpClass(cls):
        cls.map = cairn.Map.open(POSTER / "drive.cairn")
        cls.frames = [POSTER / f"{i}.pgm" for i in range(7)]
        lines = (POSTER / "odometry.txt").read_text().splitlines()
        cls.odometry = [[float(word) for word in line.split()] for line in lines if not line.startswith("#")]

    def printed(self, *words):
        run = subprocess.run([PROGRAM, "localize", POSTER / "drive.cairn", *self.frames, "--sequence", *words],
                             capture_output=True, check=True, text=True)
        return [json.loads(line) for line in run.stdout.splitlines()]

    def test_publishes_what_is_sure_as_the_program_does(self):
        options = ["--min-place-probability", "0.97", "--period", "0.4", "--odometry", POSTER / "odometry.txt"]
        tracker = cairn.Tracker(self.map, min_place_probability=0.97)
        for i, (frame, expected) in enumerate(zip(self.frames, self.printed(*options))):
            tracker.elapse(0.4)
            if i > 0:
                ahead_m, left_m, turn_deg = self.odometry[i]
                tracker.move(ahead_m, left_m, turn_deg * math.pi / 180)
            fix = tracker.track(read_pgm(frame))
            self.assertEqual(bool(fix), expected["fix"])
            self.assertEqual(fix.probability, expected.get("probability", 0))
        with self.assertRaises(cairn.Error) as caught:
            cairn.Tracker(self.map).elapse(1)
        self.assertIn("min_place_probability", str(caught.exception))

    def test_goes_on_in_the_dark_by_odometry_as_the_program_does(self):
        frames = [self.frames[0], POSTER / "blank.pgm", POSTER / "blank.pgm"]
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as wheels:
            wheels.write("0 0 0\n0.2 0.05 6\n0.3 0 0\n")
            wheels.flush()
            run = subprocess.run([PROGRAM, "localize", POSTER / "drive.cairn", *frames, "--sequence", "--odometry", wheels.name],
                                 capture_output=True, check=False, text=True)
        self.assertEqual(run.returncode, 0, run.stderr)
        tracker = cairn.Tracker(self.map)
        self.assertIsNone(tracker.believe())
        for frame, moved, line in zip(frames, ((0, 0, 0), (0.2, 0.05, 6 * math.pi / 180), (0.3, 0, 0)), run.stdout.splitlines()):
            if tracker.believe():
                tracker.move(*moved)
            fix, expected = tracker.track(read_pgm(frame)), json.loads(line)
            self.assertEqual(bool(fix), expected["fix"])
            believed = tracker.believe()
            if fix:
                self.assertEqual(believed.translation.tolist(), fix.translation.tolist())
                self.assertNotIn("believed", expected)
                continue
            self.assertEqual(believed.rotation_wxyz.tolist(), expected["believed"]["rotation_wxyz"])
            self.assertEqual(believed.translation.tolist(), expected["believed"]["translation_m"])
            self.assertEqual(believed.covariance.T.ravel().tolist(), expected["believed"]["covariance"])
        # A camera that moves ahead has what it saw nearer.
        before = believed.translation
        tracker.move_camera(cairn.UncertainPose([1, 0, 0, 0], [0, 0, -0.3], 1e-4 * numpy.eye(6)))
        numpy.testing.assert_allclose(tracker.believe().translation - before, [0, 0, -0.3], atol=1e-12)
        self.assertIn("UncertainPose", repr(believed))
        for wrong in (([1, 0, 0], [0, 0, 0]), ([2, 0, 0, 0], [0, 0, 0]), ([1, 0, 0, 0], [0, 0, math.nan]),
                      ([1, 0, 0, 0], [0, 0, 0], numpy.eye(5)), ([1, 0, 0, 0], [0, 0, 0], -numpy.eye(6))):
            with self.assertRaises(ValueError):
                cairn.UncertainPose(*wrong)
        with self.assertRaises(cairn.Error):
            tracker.move(math.nan, 0, 0)

    def test_in_space_gives_the_programs_poses_bit_for_bit(self):
        tracker = cairn.Tracker(self.map)
        self.assertIsNone(tracker.predict())
        for i, (frame, expected) in enumerate(zip(self.frames, self.printed())):
            fix = tracker.track(read_pgm(frame))
            self.assertTrue(fix)
            self.assertEqual(fix.rotation_wxyz.tolist(), expected["rotation_wxyz"])
            self.assertEqual(fix.translation.tolist(), expected["translation_m"])
            self.assertEqual(fix.covariance.T.ravel().tolist(), expected["covariance"])
            self.assertEqual(fix.num_inliers, expected["num_inliers"])
            self.assertEqual(fix.scope, expected["scope"])
            self.assertEqual(fix.scope, "votes" if i in (0, self.CARRIED) else "track")
            self.assertEqual(fix.voted_regions, expected.get("voted_regions", []))
            expected_next = tracker.predict()
            self.assertGreater(expected_next.sigma_m, 0)
            self.assertGreater(expected_next.sigma_deg, 0)
        # It stands there, and what is predicted is of use to a localizer.
        numpy.testing.assert_allclose(expected_next.rotation_wxyz, fix.rotation_wxyz, atol=1e-12)
        numpy.testing.assert_allclose(expected_next.translation, fix.translation, atol=1e-12)
        self.assertTrue(cairn.Localizer(self.map).localize(read_pgm(self.frames[-1]), prior=expected_next))

    def test_on_the_floor_gives_the_programs_places_bit_for_bit(self):
        tracker = cairn.VisualTracker(self.map)
        printed = self.printed("--estimator", "visual-map", "--odometry", POSTER / "odometry.txt")
        for i, (frame, moved, expected) in enumerate(zip(self.frames, self.odometry, printed)):
            if i > 0:
                tracker.move(*moved)
            fix = tracker.track(read_pgm(frame))
            self.assertTrue(fix)
            self.assertEqual(fix.reason, "none")
            self.assertEqual(fix.position.tolist(), expected["floor_m"])
            self.assertEqual(fix.heading_deg, expected["heading_deg"])
            self.assertEqual(fix.covariance.T.ravel().tolist(), expected["covariance"])
            self.assertEqual(fix.mean.tolist(), expected["mean_m"])
            self.assertEqual(fix.entropy, expected["entropy"])
            self.assertEqual(fix.scope, expected["scope"])
            self.assertEqual(fix.regions, expected["regions"])
            self.assertEqual(fix.num_matches, expected["num_matches"])
            self.assertEqual(fix.num_agreeing, expected["num_agreeing"])
        numpy.testing.assert_allclose(fix.position, [-0.3, 0.5], atol=0.05)  # where it was carried to
        self.assertIn("deg", repr(fix))

    def test_without_a_fix_there_is_a_reason_and_on_the_floor_a_belief(self):
        blank = read_pgm(POSTER / "blank.pgm")
        tracker, visual = cairn.Tracker(self.map), cairn.VisualTracker(self.map)
        tracker.track(read_pgm(self.frames[2]))
        visual.track(read_pgm(self.frames[2]))
        fix = tracker.track(blank)
        self.assertFalse(fix)
        self.assertEqual(fix.reason, "too_few_features")
        visual.move(ahead_m=0, left_m=0, turn_left_rad=0)
        on_floor = visual.track(blank)
        self.assertFalse(on_floor)
        self.assertEqual(on_floor.reason, "too_few_matches")
        self.assertIn("landmarks", on_floor.message)
        self.assertIsNone(on_floor.position)
        self.assertIsNone(on_floor.heading_deg)
        numpy.testing.assert_allclose(on_floor.mean, [-0.7, -0.4], atol=0.15)
        self.assertGreater(on_floor.entropy, 0)
        self.assertEqual(on_floor.covariance.shape, (3, 3))
        self.assertIn("too_few_matches", repr(on_floor))

    def test_options_reach_the_trackers(self):
        first = read_pgm(self.frames[0])
        self.assertFalse(cairn.Tracker(self.map, min_num_inliers=100000).track(first))
        tracker = cairn.Tracker(self.map, step_sigma_m=2, max_prior_sigma_m=9)
        tracker.track(first)
        self.assertEqual(tracker.predict().sigma_m, 2)
        self.assertFalse(cairn.VisualTracker(self.map, min_num_agreeing=100000).track(first))
        with self.assertRaisesRegex(cairn.Error, "did you mean 'step_sigma_m'"):
            cairn.Tracker(self.map, step_sigma=1)
        with self.assertRaisesRegex(cairn.Error, "kidnapped_ratio"):
            cairn.VisualTracker(self.map, kidnapped_ratio=2)
        with self.assertRaisesRegex(cairn.Error, "min_num_inliers"):  # which a visual tracker does not read
            cairn.VisualTracker(self.map, min_num_inliers=9)

    def test_bad_arguments_are_refused_and_change_nothing(self):
        tracker, visual = cairn.Tracker(self.map), cairn.VisualTracker(self.map)
        first, second = (read_pgm(frame) for frame in self.frames[:2])
        tracker.track(first)
        visual.track(first)
        for one in tracker, visual:
            with self.assertRaisesRegex(TypeError, "float32"):
                one.track(first.astype(numpy.float32))
            with self.assertRaisesRegex(ValueError, "one channel"):
                one.track(numpy.dstack([first] * 3))
            with self.assertRaises(cairn.Error) as caught:
                one.track(first[:100])
            self.assertEqual(caught.exception.name, "not_found")
            self.assertEqual(one.track(second, camera=self.map.camera_for_size(320, 240)).scope, "track")
        with self.assertRaises(cairn.Error) as caught:
            visual.move(float("nan"), 0, 0)
        self.assertEqual(caught.exception.name, "invalid_argument")
        with self.assertRaises(TypeError):
            visual.move(0.1)
        with self.assertRaises(cairn.Error) as caught:
            cairn.VisualTracker(cairn.Map.open(POSTER / "poster.cairn"))
        self.assertEqual(caught.exception.name, "not_found")
        for kind in cairn.Tracker, cairn.VisualTracker:
            with self.assertRaises(TypeError):
                kind("drive.cairn")

    def test_two_threads_at_once_get_busy(self):
        image = read_pgm(self.frames[0])
        for tracker in cairn.Tracker(self.map), cairn.VisualTracker(self.map):
            codes = []

            def track():
                for _ in range(5):
                    try:
                        codes.append(0 if tracker.track(image) else -1)
                    except cairn.Error as error:
                        codes.append(error.code)
            threads = [threading.Thread(target=track) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(set(codes), {0, 9})  # fixes, and busy: the interpreter's lock is free meanwhile

    def test_a_tracker_outlives_its_map(self):
        map = cairn.Map.open(POSTER / "drive.cairn")
        tracker, visual = cairn.Tracker(map), cairn.VisualTracker(map)
        del map
        self.assertTrue(tracker.track(read_pgm(self.frames[0])))
        self.assertTrue(visual.track(read_pgm(self.frames[0])))


class Refusing(Poster):
    def refused(self, image, kind, *words):
        with self.assertRaises(kind) as caught:
            self.localizer.localize(image)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_arrays_of_the_wrong_dtype_shape_or_order(self):
        self.refused(self.image.astype(numpy.float32), TypeError, "float32", "uint8")
        self.refused(self.image.astype(numpy.int8), TypeError, "int8")
        self.refused(numpy.dstack([self.image] * 3), ValueError, "(240, 320, 3)", "one channel")
        self.refused(self.image.ravel(), ValueError, "(76800,)", "(height, width)")
        self.refused(self.image[:0], ValueError, "(0, 320)")
        self.refused(numpy.asfortranarray(self.image), ValueError, "strides (1, 240)", "ascontiguousarray")
        self.refused(self.image[::-1], ValueError, "strides (-320, 1)")
        self.refused(self.image[:, ::-1], ValueError, "strides (320, -1)")
        self.refused(self.image[:, ::2], ValueError, "strides (320, 2)")
        self.refused(numpy.broadcast_to(self.image[0], (240, 320)), ValueError, "strides (0, 1)")
        self.refused([[1, 2], [3, 4]], TypeError)
        self.refused(None, TypeError)

    def test_image_of_a_size_that_the_map_lacks(self):
        with self.assertRaises(cairn.Error) as caught:
            self.localizer.localize(self.image[:100])
        self.assertEqual((caught.exception.code, caught.exception.name), (3, "not_found"))
        self.assertIn("320", str(caught.exception))

    def test_files_that_are_no_maps_have_codes(self):
        with self.assertRaises(cairn.Error) as caught:
            cairn.Map.open("/nowhere/a.cairn")
        self.assertEqual(caught.exception.code, 3)
        self.assertIn("/nowhere/a.cairn", str(caught.exception))
        with self.assertRaises(cairn.Error) as caught:
            cairn.Map.open(POSTER / "poster.pgm")
        self.assertEqual(caught.exception.name, "not_sqlite")
        with self.assertRaises(cairn.Error) as caught:
            cairn.Map.open(POSTER / "poster.cairn", public_key=bytes(31) + b"\1")
        self.assertEqual(caught.exception.name, "not_signed")
        with self.assertRaisesRegex(ValueError, "5 bytes, expected 32"):
            cairn.Map.open(POSTER / "poster.cairn", public_key=b"abcde")
        with self.assertRaises(TypeError):
            cairn.Map.open(7)
        for path in ["", str(POSTER / "poster.cairn") + "\0zzz"]:
            with self.assertRaises(ValueError):
                cairn.Map.open(path)

    def test_bad_cameras_priors_and_options(self):
        with self.assertRaisesRegex(cairn.Error, "takes 4 parameters, found 1"):
            cairn.Camera("PINHOLE", 320, 240, [280])
        with self.assertRaisesRegex(cairn.Error, "PINHOL"):
            cairn.Camera("PINHOL", 320, 240, [280, 160, 120])
        with self.assertRaisesRegex(ValueError, "unit quaternion"):
            cairn.Prior([0, 0, 0, 0], [0, 0, 0])
        with self.assertRaisesRegex(ValueError, "expected 4 and 3"):
            cairn.Prior([1, 0, 0, 0], [0, 0])
        with self.assertRaisesRegex(cairn.Error, "did you mean 'min_num_inliers'"):
            cairn.Localizer(self.map, min_num_inlier=3)
        with self.assertRaisesRegex(cairn.Error, "min_num_inliers"):
            cairn.Localizer(self.map, min_num_inliers="many")
        with self.assertRaises(TypeError):
            cairn.Localizer("poster.cairn")

    def test_objects_that_no_constructor_has_made(self):
        made = self.localizer.localize(self.image)
        uses = [lambda: cairn.Localizer(cairn.Map.__new__(cairn.Map)),
                lambda: cairn.Localizer.__new__(cairn.Localizer).localize(self.image),
                lambda: cairn.Map.__new__(cairn.Map).camera_for_size(320, 240),
                lambda: self.localizer.localize(self.image, camera=cairn.Camera.__new__(cairn.Camera)),
                lambda: self.localizer.localize(self.image, prior=cairn.Prior.__new__(cairn.Prior)),
                lambda: self.localizer.localize(self.image, up=cairn.Up.__new__(cairn.Up)),
                lambda: self.localizer.localize_rig([cairn.RigImage.__new__(cairn.RigImage)]),
                lambda: bool(cairn.Fix.__new__(cairn.Fix)),
                lambda: bool(cairn.FloorFix.__new__(cairn.FloorFix)),
                lambda: cairn.Tracker(cairn.Map.__new__(cairn.Map)),
                lambda: cairn.Tracker.__new__(cairn.Tracker).track(self.image),
                lambda: cairn.Tracker.__new__(cairn.Tracker).predict(),
                lambda: cairn.VisualTracker(cairn.Map.__new__(cairn.Map)),
                lambda: cairn.VisualTracker.__new__(cairn.VisualTracker).track(self.image),
                lambda: cairn.VisualTracker.__new__(cairn.VisualTracker).move(0, 0, 0),
                lambda: cairn.Tracker(self.map).track(self.image, camera=cairn.Camera.__new__(cairn.Camera))]
        on_floor = cairn.VisualTracker(cairn.Map.open(POSTER / "drive.cairn")).track(self.image)
        prior = cairn.Prior([1, 0, 0, 0], [0, 0, 0])
        up, rig_image = cairn.Up((0, -1, 0)), cairn.RigImage(self.image)
        for example in self.map, self.map.camera_for_size(320, 240), made, on_floor, prior, up, rig_image:
            kind = type(example)
            uses.append(lambda kind=kind: repr(kind.__new__(kind)))
            for name, value in vars(kind).items():
                if isinstance(value, property):
                    uses.append(lambda kind=kind, name=name: getattr(kind.__new__(kind), name))
        self.assertGreater(len(uses), 40)
        for use in uses:
            with self.assertRaisesRegex(TypeError, "__init__ has not been called"):
                use()


class Updates(Poster):
    def test_map_is_updated_by_a_delta_and_rolled_back(self):
        with tempfile.TemporaryDirectory() as folder:
            old, new, delta = (pathlib.Path(folder) / name for name in ["old.cairn", "new.cairn", "delta"])
            old.write_bytes((POSTER / "poster.cairn").read_bytes())
            key = pathlib.Path(folder) / "key"
            for words in [["keygen", key], ["sign", old, "--key", key, "-o", new], ["update", "delta", old, new, "-o", delta]]:
                run = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
                self.assertEqual(run.returncode, 0, run.stderr)
            before, after = old.read_bytes(), new.read_bytes()
            self.assertTrue(cairn.update_map(old, delta))
            self.assertEqual(old.read_bytes(), after)
            self.assertFalse(cairn.update_map(old, delta))
            cairn.roll_back_map(old)
            self.assertEqual(old.read_bytes(), before)
            with self.assertRaises(cairn.Error) as caught:
                cairn.update_map(old, delta, public_key=bytes(32))
            self.assertIn(caught.exception.name, ["not_signed", "wrong_key"])
            with self.assertRaises(ValueError):
                cairn.update_map(old, delta, public_key=b"short")
            with self.assertRaises(TypeError):
                cairn.update_map(old, delta, min_epoch=-1)
            with self.assertRaises(cairn.Error) as caught:
                cairn.roll_back_map(delta)
            self.assertEqual(caught.exception.name, "not_found")

    def test_signed_maps_go_forward_unless_told_otherwise(self):
        with tempfile.TemporaryDirectory() as folder:
            first, second, delta, key = (pathlib.Path(folder) / name for name in ["1.cairn", "2.cairn", "delta", "key"])
            map = POSTER / "poster.cairn"
            for words in [["keygen", key], ["sign", map, "--key", key, "-o", first],
                          ["sign", map, "--key", key, "--after", first, "-o", second],
                          ["update", "delta", second, first, "-o", delta, "--key", key, "--allow-older"]]:
                run = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
                self.assertEqual(run.returncode, 0, run.stderr)
            public_key = bytes.fromhex(pathlib.Path(str(key) + ".pub").read_text())
            self.assertEqual(cairn.Map.open(second, public_key=public_key, name="poster", min_epoch=2).epoch, 2)
            for call, name in [
                (lambda: cairn.Map.open(second, min_epoch=3), "not_newer"),
                (lambda: cairn.Map.open(second, name="wall"), "other_map"),
                (lambda: cairn.update_map(second, delta, public_key=public_key), "not_newer"),
                (lambda: cairn.update_map(second, delta, name="wall", allow_older=True), "other_map"),
            ]:
                with self.assertRaises(cairn.Error) as caught:
                    call()
                self.assertEqual(caught.exception.name, name)
            self.assertTrue(cairn.update_map(second, delta, public_key=public_key, allow_older=True))
            self.assertEqual(cairn.Map.open(second).epoch, 1)
            with self.assertRaises(cairn.Error) as caught:
                cairn.roll_back_map(second, public_key=public_key, min_epoch=3)
            self.assertEqual(caught.exception.name, "not_newer")
            cairn.roll_back_map(second, public_key=public_key, min_epoch=2)
            self.assertEqual(cairn.Map.open(second).epoch, 2)

    def test_ring_of_keys_is_trusted_and_replaced(self):
        with tempfile.TemporaryDirectory() as folder:
            first, second, delta, ring, following = (pathlib.Path(folder) / name for name in ["1", "2", "d", "ring", "next"])
            alice, bob, carol = (pathlib.Path(folder) / name for name in ["alice", "bob", "carol"])
            for words in [["keygen", alice], ["keygen", bob], ["keygen", carol],
                          ["keys", "make", f"alice={alice}.pub", f"bob={bob}.pub", "--threshold", "2", "-o", ring],
                          ["keys", "make", f"carol={carol}.pub", f"bob={bob}.pub", "--threshold", "2", "--after", ring, "-o", following],
                          ["keys", "sign", following, "--key", alice], ["keys", "sign", following, "--key", bob],
                          ["sign", POSTER / "poster.cairn", "--key", alice, "-o", first],
                          ["sign", POSTER / "poster.cairn", "--key", alice, "--after", first, "-o", second],
                          ["update", "delta", first, second, "-o", delta, "--key", alice],
                          ["sign", first, "--key", bob, "--add"]]:
                run = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
                self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(cairn.Map.open(first, key_ring=ring).epoch, 1)
            for call, name in [
                (lambda: cairn.Map.open(second, key_ring=ring), "not_signed"),
                (lambda: cairn.update_map(first, delta, key_ring=ring), "not_signed"),
                (lambda: cairn.Map.open(first, key_ring=first), "corrupt"),
                (lambda: cairn.accept_key_ring(ring, following), "not_signed"),
            ]:
                with self.assertRaises(cairn.Error) as caught:
                    call()
                self.assertEqual(caught.exception.name, name)
            with self.assertRaises(ValueError):
                cairn.Map.open(first, key_ring=ring, public_key=bytes(32))
            sent = pathlib.Path(folder) / "sent"
            subprocess.run([PROGRAM, "sign", second, "--key", bob, "--add", "-o", sent], check=True, capture_output=True)
            self.assertTrue(cairn.update_map(first, delta, key_ring=ring, signatures=sent))
            self.assertEqual(cairn.Map.open(first, key_ring=ring).epoch, 2)
            cairn.roll_back_map(first, key_ring=ring)
            self.assertEqual(cairn.Map.open(first, key_ring=ring).epoch, 1)
            subprocess.run([PROGRAM, "keys", "sign", following, "--key", carol], check=True, capture_output=True)
            self.assertEqual(cairn.accept_key_ring(ring, following), 2)
            with self.assertRaises(cairn.Error) as caught:
                cairn.Map.open(first, key_ring=ring)
            self.assertEqual(caught.exception.name, "not_signed")


class Facts(Poster):
    def test_map_and_camera_say_what_they_are(self):
        self.assertEqual(self.map.name, "poster")
        self.assertEqual(self.map.num_images, 3)
        self.assertGreater(self.map.num_landmarks, 50)
        self.assertTrue(self.map.is_metric)
        self.assertEqual(self.map.scale_sigma_ratio, 0)
        self.assertEqual(self.map.scale_centre.tolist(), [0, 0, 0])
        camera = self.map.camera_for_size(320, 240)
        self.assertEqual(repr(camera), "cairn.Camera('SIMPLE_PINHOLE', 320, 240, [280, 160, 120])")
        self.assertEqual(eval(repr(camera)).params, [280, 160, 120])

    def test_type_hints_name_what_there_is(self):
        folder = pathlib.Path(cairn.__file__).parent
        self.assertTrue((folder / "py.typed").exists())
        hints = (folder / "__init__.pyi").read_text()
        for name in cairn.__all__:
            self.assertIn(name, hints)
            kind = getattr(cairn, name)
            if not isinstance(kind, type) or kind is cairn.Error:
                continue
            for member in vars(kind):
                if not member.startswith("_"):
                    self.assertIn(f"def {member}(", hints)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
