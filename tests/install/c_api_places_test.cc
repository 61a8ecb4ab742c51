#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/c_api/cairn.h"
#include "runtime/drive/place_belief.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "tests/install/c_image.h"
#include "tests/install/poster_wings.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The map of two wings, in C and in C++.  It is closed in C before a test uses what was made of it, unless
// the test needs it.
class CPlaces : public testing::Test {
 protected:
  CPlaces() : path_(testing::TempDir() + "/c_api_wings.cairn") {
    EXPECT_TRUE(WriteMapRows(Wings().rows(), path_).ok());
    map_ = *Map::Open(path_);
    EXPECT_EQ(cairn_map_open(path_.c_str(), nullptr, &opened_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_place_model_create(opened_, &model_), CAIRN_OK) << cairn_last_error();
    places_.num_places = 11;
    places_.scores = scores_.data();
    places_.probabilities = probabilities_.data();
  }
  ~CPlaces() override {
    EXPECT_EQ(cairn_place_model_destroy(model_), CAIRN_OK);
    EXPECT_EQ(cairn_map_close(opened_), CAIRN_OK);
  }

  void Look(int picture) {
    const cairn_image image = ImageOf(Wings().pictures()[picture]);
    ASSERT_EQ(cairn_place_model_look(model_, &image, &places_), CAIRN_OK) << cairn_last_error();
  }
  static DescriptorMatrix DescriptorsOf(int picture) {
    return ExtractSift(Wings().pictures()[picture], {})->descriptors;
  }
  // The numbers that cairn_route writes; empty after an error.
  std::vector<int32_t> Route(int32_t from, int32_t to, const char* weight, double* cost = nullptr) {
    std::vector<int32_t> images(20);
    int32_t num_images = -1;
    if (cairn_route(opened_, from, to, weight, images.data(), 20, &num_images, cost) != CAIRN_OK) return {};
    images.resize(num_images);
    return images;
  }

  std::string path_;
  std::shared_ptr<const Map> map_;
  cairn_map* opened_ = nullptr;
  cairn_place_model* model_ = nullptr;
  std::vector<double> scores_ = std::vector<double>(11, -1), probabilities_ = scores_;
  cairn_place_scores places_ = CAIRN_PLACE_SCORES_INIT;
};

TEST_F(CPlaces, RoutesMinimiseWhatTheyAreAskedTo) {
  double cost = -1;
  EXPECT_THAT(Route(8, 10, nullptr, &cost), ElementsAre(8, 10));
  EXPECT_EQ(cost, 1);
  EXPECT_THAT(Route(8, 10, "links"), ElementsAre(8, 10));
  EXPECT_THAT(Route(8, 10, "matches", &cost), ElementsAre(8, 9, 10));  // 1/40 + 1/40 < 1/10
  EXPECT_EQ(cost, 2.0 / 40);
  EXPECT_THAT(Route(0, 9, "entropy", &cost), ElementsAre(0, 1, 2, 3, 8, 9));
  EXPECT_EQ(cost, 0.5 + 0.25 + 0.25 + 0.25);
  EXPECT_THAT(Route(3, 3, "links"), ElementsAre(3));
}

TEST_F(CPlaces, RoutesSayHowMuchRoomTheyNeed) {
  int32_t num_images = -1;
  ASSERT_EQ(cairn_route(opened_, 0, 9, "links", nullptr, 0, &num_images, nullptr), CAIRN_OK);
  EXPECT_EQ(num_images, 6);
  std::vector<int32_t> images(3, -7);
  ASSERT_EQ(cairn_route(opened_, 0, 9, "links", images.data(), 2, &num_images, nullptr), CAIRN_OK);
  EXPECT_EQ(num_images, 6);
  EXPECT_THAT(images, ElementsAre(0, 1, -7));
}

TEST_F(CPlaces, RoutesRefuseWhatCannotBe) {
  int32_t num_images = -1;
  std::vector<int32_t> images(20);
  const auto route = [&](int32_t from, int32_t to, const char* weight, int32_t* into, int32_t capacity) {
    return cairn_route(opened_, from, to, weight, into, capacity, &num_images, nullptr);
  };
  EXPECT_EQ(route(0, 11, "links", images.data(), 20), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(num_images, 0);
  EXPECT_EQ(route(-1, 0, "links", images.data(), 20), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(route(0, 9, "metres", images.data(), 20), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("entropy"));
  EXPECT_EQ(route(0, 9, "links", nullptr, 20), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(route(0, 9, "links", images.data(), -1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_route(opened_, 0, 9, "links", images.data(), 20, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("num_images is NULL"));
  EXPECT_EQ(cairn_route(nullptr, 0, 9, "links", images.data(), 20, &num_images, nullptr),
            CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlaces, SurveyImagesHaveNumbersNamesAndPoses) {
  int32_t image = -1;
  ASSERT_EQ(cairn_map_find_image(opened_, "b2", &image), CAIRN_OK);
  EXPECT_EQ(image, 6);
  cairn_survey_image said = CAIRN_SURVEY_IMAGE_INIT;
  ASSERT_EQ(cairn_map_describe_image(opened_, image, &said), CAIRN_OK);
  EXPECT_STREQ(said.name, "b2");
  const Pose pose = *PoseOfImage(*map_, 6);
  EXPECT_EQ(Eigen::Vector3d(said.translation_m), pose.translation);
  EXPECT_EQ(Eigen::Vector3d(said.center_m), pose.Center());
  EXPECT_EQ(said.rotation_wxyz[0], pose.rotation.w());
  EXPECT_NEAR(said.center_m[1], 60.3, 1e-6);
  EXPECT_EQ(cairn_map_find_image(opened_, "c0", &image), CAIRN_NOT_FOUND);
  EXPECT_EQ(cairn_map_find_image(opened_, nullptr, &image), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_describe_image(opened_, 11, &said), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_describe_image(opened_, 0, nullptr), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlaces, LooksSayWhatTheCxxModelSaysBitForBit) {
  ASSERT_EQ(cairn_map_close(opened_), CAIRN_OK);
  opened_ = nullptr;
  const PlaceModel model = *PlaceModel::Make(*map_);
  int32_t num_places = 0;
  ASSERT_EQ(cairn_place_model_num_places(model_, &num_places), CAIRN_OK);
  EXPECT_EQ(num_places, 11);
  for (int i = 0; i < 7; ++i) {
    const PlaceScores expected = model.Look(DescriptorsOf(i));
    Look(i);
    EXPECT_EQ(scores_, expected.scores) << i;
    EXPECT_EQ(probabilities_, expected.probabilities) << i;
    const DescriptorMatrix descriptors = DescriptorsOf(i);
    std::vector<double> of_features(11);
    places_.scores = nullptr;  // not wanted
    places_.probabilities = of_features.data();
    ASSERT_EQ(cairn_place_model_look_at_features(model_, descriptors.data(),
                                                 static_cast<int32_t>(descriptors.rows()), &places_),
              CAIRN_OK);
    EXPECT_EQ(of_features, expected.probabilities);
    places_.scores = scores_.data();
    places_.probabilities = probabilities_.data();
  }
  std::vector<double> expected(11);
  ASSERT_EQ(cairn_place_model_expected(model_, 6, expected.data(), 11), CAIRN_OK);
  EXPECT_EQ(expected, model.Expected(6));
  EXPECT_GT(expected[6], 0.9);  // like no other
  int32_t number = -1;
  ASSERT_EQ(cairn_place_model_place_of_image(model_, 6, &number), CAIRN_OK);
  EXPECT_EQ(number, 6);
  ASSERT_EQ(cairn_place_model_image_of_place(model_, 8, &number), CAIRN_OK);
  EXPECT_EQ(number, 8);
}

TEST_F(CPlaces, ACloserLookIsTheCxxOne) {
  const PlaceModel model = *PlaceModel::Make(*map_);
  const cv::Mat& picture = Wings().pictures()[2];
  const Query query = *Localizer(map_).QueryFromImage(picture, *map_->CameraForSize(320, 240));
  const cairn_image image = ImageOf(picture);
  ASSERT_EQ(cairn_place_model_look_closer(model_, &image, nullptr, &places_), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(scores_, model.LookCloser(*map_, query)->scores);
  EXPECT_EQ(std::max_element(scores_.begin(), scores_.end()) - scores_.begin(), 6);
  ASSERT_EQ(cairn_place_model_set_option(model_, "num_candidates", "0"), CAIRN_OK);
  ASSERT_EQ(cairn_place_model_look_closer(model_, &image, nullptr, &places_), CAIRN_OK);
  EXPECT_EQ(scores_, model.Look(query.features.descriptors).scores);
  const cairn_image part = ImageOf(picture(cv::Rect(0, 0, 100, 100)));  // of no camera of the survey
  EXPECT_EQ(cairn_place_model_look_closer(model_, &part, nullptr, &places_), CAIRN_NOT_FOUND);
}

TEST_F(CPlaces, OptionsOfLooksHaveAnEffectAndOthersAreRefused) {
  Look(0);
  const std::vector<double> before = probabilities_;
  ASSERT_EQ(cairn_place_model_set_option(model_, "score_exponent", "1"), CAIRN_OK);
  Look(0);
  EXPECT_EQ(probabilities_,
            PlaceModel::Make(*map_, {.score_exponent = 1})->Look(DescriptorsOf(0)).probabilities);
  EXPECT_NE(probabilities_, before);
  ASSERT_EQ(cairn_place_model_set_option(model_, "max_num_features", "20"), CAIRN_OK);
  Look(0);
  const DescriptorMatrix few = ExtractSift(Wings().pictures()[0], {.max_num_features = 20})->descriptors;
  EXPECT_EQ(scores_, PlaceModel::Make(*map_)->Look(few).scores);
  EXPECT_EQ(cairn_place_model_set_option(model_, "score_exponent", "-1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_set_option(model_, "keypoint_sigma_px", "1"), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlaces, LooksRefuseWhatCannotBe) {
  const cairn_image image = ImageOf(Wings().pictures()[0]);
  EXPECT_EQ(cairn_place_model_look(nullptr, &image, &places_), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_look(model_, nullptr, &places_), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_look(model_, &image, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_look_at_features(model_, nullptr, 1, &places_), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_look_at_features(model_, nullptr, -1, &places_), CAIRN_INVALID_ARGUMENT);
  ASSERT_EQ(cairn_place_model_look_at_features(model_, nullptr, 0, &places_), CAIRN_OK);
  EXPECT_THAT(scores_, testing::Each(0));  // nothing is known
  std::vector<double> numbers(11);
  EXPECT_EQ(cairn_place_model_expected(model_, 11, numbers.data(), 11), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_expected(model_, 0, numbers.data(), 10), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_expected(model_, 0, nullptr, 11), CAIRN_INVALID_ARGUMENT);
  int32_t number = 0;
  EXPECT_EQ(cairn_place_model_place_of_image(model_, 11, &number), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_image_of_place(model_, -1, &number), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_model_num_places(model_, nullptr), CAIRN_INVALID_ARGUMENT);
  places_.num_places = 10;
  EXPECT_EQ(cairn_place_model_look(model_, &image, &places_), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("places->num_places is 10, but the map has 11"));
  EXPECT_EQ(cairn_place_model_look(reinterpret_cast<cairn_place_model*>(opened_), &image, &places_),
            CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlaces, AMapWithoutWordsHasNoPlaces) {
  MapRows rows = Wings().rows();
  rows.vocabulary = {};
  const std::string path = testing::TempDir() + "/c_api_no_words.cairn";
  ASSERT_TRUE(WriteMapRows(rows, path).ok());
  cairn_map* map = nullptr;
  cairn_place_model* model = model_;
  ASSERT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK);
  EXPECT_EQ(cairn_place_model_create(map, &model), CAIRN_NOT_FOUND);
  EXPECT_THAT(cairn_last_error(), HasSubstr("words = \"survey\""));
  EXPECT_EQ(model, nullptr);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

class CStarts : public CPlaces {
 protected:
  CStarts() {
    Look(0);
    EXPECT_EQ(cairn_start_hypotheses_create(model_, &places_, 9, &starts_), CAIRN_OK) << cairn_last_error();
  }
  ~CStarts() override { EXPECT_EQ(cairn_start_hypotheses_destroy(starts_), CAIRN_OK); }

  cairn_start_hypothesis Get(int32_t number) {
    cairn_start_hypothesis start = CAIRN_START_HYPOTHESIS_INIT;
    EXPECT_EQ(cairn_start_hypotheses_get(starts_, number, &start), CAIRN_OK) << cairn_last_error();
    return start;
  }
  std::vector<int32_t> Way(int32_t number, int32_t from_whereabouts) {
    std::vector<int32_t> places(20);
    int32_t num_places = -1;
    EXPECT_EQ(cairn_start_hypotheses_way(starts_, number, from_whereabouts, places.data(), 20, &num_places),
              CAIRN_OK)
        << cairn_last_error();
    places.resize(num_places);
    return places;
  }
  int32_t Observe(int picture) {
    int32_t verdict = -1;
    Look(picture);
    EXPECT_EQ(cairn_start_hypotheses_observe(starts_, &places_, &verdict), CAIRN_OK) << cairn_last_error();
    return verdict;
  }
  void ExpectSame(const StartHypotheses& expected) {
    int32_t num_starts = -1;
    ASSERT_EQ(cairn_start_hypotheses_count(starts_, &num_starts), CAIRN_OK);
    ASSERT_EQ(num_starts, expected.hypotheses().size());
    for (int32_t i = 0; i < num_starts; ++i) {
      const cairn_start_hypothesis start = Get(i);
      const StartHypothesis& of_cxx = expected.hypotheses()[i];
      EXPECT_EQ(start.start, of_cxx.start);
      EXPECT_EQ(start.score, of_cxx.score);
      EXPECT_EQ(start.posterior, of_cxx.posterior);
      EXPECT_EQ(start.way_cost, of_cxx.path.cost);
      EXPECT_EQ(start.num_way_places, of_cxx.path.nodes.size());
      EXPECT_EQ(start.is_followed, i == expected.followed());
      EXPECT_EQ(start.whereabouts, expected.Whereabouts(i));
      EXPECT_EQ(Way(i, 0), of_cxx.path.nodes);
      EXPECT_EQ(Way(i, 1), expected.Replan(i)->nodes);
    }
  }

  cairn_start_hypotheses* starts_ = nullptr;
};

TEST_F(CStarts, AreThoseOfCxxBitForBitImageAfterImage) {
  const PlaceModel model = *PlaceModel::Make(*map_);
  StartHypotheses expected = *StartHypotheses::Make(model, model.Look(DescriptorsOf(0)), 9);
  ExpectSame(expected);
  std::vector<std::string> verdicts;
  for (int i = 1; i < 6; ++i) {
    const int32_t verdict = Observe(i);
    EXPECT_EQ(verdict, static_cast<int32_t>(expected.Observe(model.Look(DescriptorsOf(i)))));
    verdicts.emplace_back(cairn_verdict_name(verdict));
    ExpectSame(expected);
    if (i != 3) continue;
    ASSERT_EQ(cairn_start_hypotheses_restart(starts_), CAIRN_OK);
    expected.Restart();
    ExpectSame(expected);
  }
  EXPECT_EQ(verdicts[0], "follow");
  EXPECT_EQ(verdicts[1], "switch");  // the third place of wing b
}

TEST_F(CStarts, OutliveTheirModelAndTheMap) {
  ASSERT_EQ(cairn_place_model_destroy(model_), CAIRN_OK);
  ASSERT_EQ(cairn_place_model_create(opened_, &model_), CAIRN_OK);
  EXPECT_EQ(Observe(1), CAIRN_VERDICT_FOLLOW);
  EXPECT_EQ(Observe(2), CAIRN_VERDICT_SWITCH);
}

TEST_F(CStarts, AnImageFromElsewhereIsLostAndARefutedStartIsGone) {
  const int32_t other = Get(0).is_followed ? 1 : 0;
  int32_t is_other = -1;
  ASSERT_EQ(cairn_start_hypotheses_refute(starts_, &is_other), CAIRN_OK);
  EXPECT_EQ(is_other, 1);
  EXPECT_EQ(Get(other).posterior, 1);
  EXPECT_EQ(Get(other).is_followed, 1);
  ASSERT_EQ(cairn_start_hypotheses_refute(starts_, &is_other), CAIRN_OK);
  EXPECT_EQ(is_other, 0);
  EXPECT_EQ(Observe(6), CAIRN_VERDICT_LOST);  // h2 after b0
}

TEST_F(CStarts, OptionsBeginAnewWithTheFirstImage) {
  EXPECT_EQ(Observe(1), CAIRN_VERDICT_FOLLOW);
  EXPECT_EQ(Observe(2), CAIRN_VERDICT_SWITCH);
  ASSERT_EQ(cairn_start_hypotheses_set_option(starts_, "switching", "false"), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(Get(0).posterior, 0.5);
  EXPECT_EQ(Observe(1), CAIRN_VERDICT_FOLLOW);
  EXPECT_EQ(Observe(2), CAIRN_VERDICT_FOLLOW);
  EXPECT_EQ(cairn_start_hypotheses_set_option(starts_, "reach_links", "0"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_set_option(starts_, "score_exponent", "1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("cairn drive --help"));
  EXPECT_EQ(Observe(2), CAIRN_VERDICT_FOLLOW);  // as before
}

TEST_F(CStarts, RefuseWhatCannotBe) {
  cairn_start_hypotheses* none = starts_;
  EXPECT_EQ(cairn_start_hypotheses_create(model_, &places_, 11, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(none, nullptr);
  EXPECT_EQ(cairn_start_hypotheses_create(model_, &places_, 9, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_create(model_, nullptr, 9, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_create(nullptr, &places_, 9, &none), CAIRN_INVALID_ARGUMENT);
  std::vector<double> nothing(11);
  places_.scores = nothing.data();
  EXPECT_EQ(cairn_start_hypotheses_create(model_, &places_, 9, &none), CAIRN_NO_DATA);
  nothing[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(cairn_start_hypotheses_create(model_, &places_, 9, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("finite"));

  int32_t verdict = -1, number = -1;
  places_.probabilities = nothing.data();
  nothing[3] = 0.5;
  EXPECT_EQ(cairn_start_hypotheses_observe(starts_, &places_, &verdict), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("sum to 0.5"));
  places_.probabilities = nullptr;
  EXPECT_EQ(cairn_start_hypotheses_observe(starts_, &places_, &verdict), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("probabilities is NULL"));
  places_.probabilities = probabilities_.data();
  EXPECT_EQ(cairn_start_hypotheses_observe(starts_, &places_, nullptr), CAIRN_INVALID_ARGUMENT);
  places_.num_places = 12;
  EXPECT_EQ(cairn_start_hypotheses_observe(starts_, &places_, &verdict), CAIRN_INVALID_ARGUMENT);
  cairn_start_hypothesis start = CAIRN_START_HYPOTHESIS_INIT;
  EXPECT_EQ(cairn_start_hypotheses_get(starts_, 2, &start), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_get(starts_, -1, &start), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_get(starts_, 0, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_way(starts_, 0, 2, nullptr, 0, &number), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_refute(starts_, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_count(nullptr, &number), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_start_hypotheses_restart(reinterpret_cast<cairn_start_hypotheses*>(model_)),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("not a set of starts"));
  EXPECT_STREQ(cairn_verdict_name(3), "unknown");
}

TEST_F(CPlaces, BeliefsAreThoseOfCxx) {
  cairn_place_belief* belief = nullptr;
  ASSERT_EQ(cairn_place_belief_create(opened_, &belief), CAIRN_OK) << cairn_last_error();
  PlaceBelief expected = *PlaceBelief::Make(map_);
  const Localizer localizer(map_);
  std::array<int32_t, 3> images{};
  std::array<double, 3> probabilities{};
  int32_t num_places = 0;
  double elsewhere = 0;
  for (const int picture : {0, 1, 2, 4, 5}) {
    const cv::Mat& pixels = Wings().pictures()[picture];
    const cairn_image image = ImageOf(pixels);
    cairn_fix fix = CAIRN_FIX_INIT;
    if (picture == 4) {
      ASSERT_EQ(cairn_place_belief_move(belief, 0.5, 0.1, 0.2), CAIRN_OK) << cairn_last_error();
      ASSERT_TRUE(expected.Move({0.5, 0.1}, 0.2).ok());
      ASSERT_EQ(cairn_place_belief_elapse(belief, 0.25), CAIRN_OK) << cairn_last_error();
      ASSERT_TRUE(expected.Elapse(0.25).ok());
    }
    if (picture == 5) {
      ASSERT_EQ(cairn_place_belief_sense_up(belief, 0.1, -0.9, 0.2, 3), CAIRN_OK) << cairn_last_error();
      ASSERT_TRUE(expected.SenseUp({0.1, -0.9, 0.2}, 3).ok());
    }
    ASSERT_EQ(cairn_place_belief_see(belief, &image, nullptr, picture == 1 ? nullptr : &fix), CAIRN_OK)
        << cairn_last_error();
    const Query query = *localizer.QueryFromImage(pixels, *map_->CameraForSize(pixels.cols, pixels.rows));
    const Localization found = *localizer.LocalizeQuery(query, std::nullopt);
    ASSERT_TRUE(expected.See(query, found).ok());
    if (picture != 1) EXPECT_EQ(fix.probability, found.probability);
    ASSERT_EQ(
        cairn_place_belief_places(belief, images.data(), probabilities.data(), 3, &num_places, &elsewhere),
        CAIRN_OK);
    const auto places = *expected.Hypotheses(3);
    ASSERT_EQ(num_places, static_cast<int32_t>(places.size()));
    for (int32_t i = 0; i < num_places; ++i) {
      EXPECT_EQ(images[i], places[i].image);
      EXPECT_EQ(probabilities[i], places[i].probability);
    }
    EXPECT_EQ(elsewhere, expected.elsewhere());
  }
  // Anew.
  ASSERT_EQ(cairn_place_belief_set_option(belief, "elsewhere_ratio", "0.25"), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_place_belief_places(belief, nullptr, nullptr, 0, &num_places, &elsewhere), CAIRN_OK);
  EXPECT_EQ(num_places, 0);
  EXPECT_EQ(elsewhere, 0.25);
  EXPECT_EQ(cairn_place_belief_destroy(belief), CAIRN_OK);
  EXPECT_EQ(cairn_place_belief_move(belief, 0, 0, 0), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlaces, MisuseOfBeliefsIsSaid) {
  EXPECT_EQ(cairn_place_belief_create(opened_, nullptr), CAIRN_INVALID_ARGUMENT);
  cairn_place_belief* belief = nullptr;
  EXPECT_EQ(cairn_place_belief_create(nullptr, &belief), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(belief, nullptr);
  ASSERT_EQ(cairn_place_belief_create(opened_, &belief), CAIRN_OK);
  EXPECT_EQ(cairn_place_belief_set_option(belief, "elsewhere", "1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_set_option(belief, "elsewhere_ratio", "1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("elsewhere_ratio"));
  EXPECT_EQ(cairn_place_belief_move(belief, std::numeric_limits<double>::quiet_NaN(), 0, 0),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_elapse(belief, -1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_sense_up(belief, 0, 0, 0, 1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_sense_up(belief, 0, -1, 0, 0), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_see(belief, nullptr, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  int32_t num_places = 7, image = 0;
  EXPECT_EQ(cairn_place_belief_places(belief, nullptr, nullptr, 1, &num_places, nullptr),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(num_places, 0);
  EXPECT_EQ(cairn_place_belief_places(belief, &image, nullptr, 1, &num_places, nullptr),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("probabilities is NULL"));
  EXPECT_EQ(cairn_place_belief_places(belief, nullptr, nullptr, -1, &num_places, nullptr),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_places(belief, nullptr, nullptr, 0, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_place_belief_destroy(belief), CAIRN_OK);
}

}  // namespace
}  // namespace cairn
