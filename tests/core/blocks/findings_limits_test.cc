// Findings at the limits of what they may be, and beyond.
#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_findings.h"

namespace cairn {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr MapSizes kSizes = {.num_regions = 2, .num_stations = 3, .num_images = 4, .num_sessions = 3};

// The message about findings; "" where there is none.
std::string RefusalOfFindings(const MapFindings& findings) {
  const Status status = CheckMapFindings(findings, kSizes);
  return status.ok() ? "" : status.error().message;
}

std::string SelfTestRefusal(const std::vector<RegionSelfTest>& rows) {
  return RefusalOfFindings({.self_test_regions = rows});
}

TEST(FindingsLimits, SelfTestsAreOfRegionsThatThereAre) {
  const RegionSelfTest::Errors none;
  EXPECT_EQ(SelfTestRefusal({{-1, 1, 0, 0, {}}, {0, 1, 1, 1, none}, {1, 2, 1, 0, none}}), "");
  EXPECT_THAT(SelfTestRefusal({{-2, 1, 0, 0, {}}}), HasSubstr("self-test of region -2 of 2"));
  EXPECT_THAT(SelfTestRefusal({{2, 1, 0, 0, {}}}), HasSubstr("self-test of region 2 of 2"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 0, 0, {}}, {0, 1, 0, 0, {}}}), HasSubstr("region 0 is out of order"));
  EXPECT_THAT(SelfTestRefusal({{1, 1, 0, 0, {}}, {0, 1, 0, 0, {}}}), HasSubstr("region 0 is out of order"));
  EXPECT_THAT(SelfTestRefusal({{0, 0, 0, 0, {}}}), HasSubstr("0 gross errors of 0 localized of 0 images"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, -1, 0, {}}}), HasSubstr("0 gross errors of -1 localized"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 2, 0, none}}), HasSubstr("2 localized of 1 images"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 1, 2, none}}), HasSubstr("2 gross errors of 1"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 1, -1, none}}), HasSubstr("-1 gross errors"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 1, 0, {}}}), HasSubstr("1 localized, with errors: false"));
  EXPECT_THAT(SelfTestRefusal({{0, 1, 0, 0, none}}), HasSubstr("0 localized, with errors: true"));
  for (const double bad : {-1e-9, kInfinite, std::nan("")}) {
    for (const auto& field : {&RegionSelfTest::Errors::median_m, &RegionSelfTest::Errors::median_deg,
                              &RegionSelfTest::Errors::p90_m, &RegionSelfTest::Errors::p90_deg}) {
      RegionSelfTest::Errors errors;
      errors.*field = bad;
      EXPECT_THAT(SelfTestRefusal({{1, 1, 1, 0, errors}}), HasSubstr("self-test of region 1: an error of "));
    }
  }
}

TEST(FindingsLimits, EntropiesAreOfRegionsInOrder) {
  const auto refusal = [](const std::vector<RegionEntropy>& rows) {
    return RefusalOfFindings({.region_entropies = rows});
  };
  EXPECT_EQ(refusal({{0, 0}, {1, 2.5}}), "");
  for (const std::vector<RegionEntropy>& rows : std::vector<std::vector<RegionEntropy>>{{{-1, 0}},
                                                                                        {{2, 0}},
                                                                                        {{0, 0}, {0, 0}},
                                                                                        {{1, 0}, {0, 0}},
                                                                                        {{0, -1e-9}},
                                                                                        {{0, kInfinite}},
                                                                                        {{0, std::nan("")}}})
    EXPECT_THAT(refusal(rows), HasSubstr("an entropy of "));
}

TEST(FindingsLimits, DropsCountWhatThereIs) {
  const auto refusal = [](const std::vector<DropCount>& rows) { return RefusalOfFindings({.drops = rows}); };
  const auto drop = [](int reason, int64_t num, const std::vector<int32_t>& at) {
    return DropCount{reason, "stage", "kind", "name", "text", num, at};
  };
  EXPECT_EQ(refusal({drop(0, 1, {}), drop(1, 5, {0, 5, 0})}), "");
  EXPECT_THAT(refusal({drop(-1, 1, {})}), HasSubstr("1 dropped for reason -1"));
  EXPECT_THAT(refusal({drop(0, 0, {})}), HasSubstr("0 dropped for reason 0"));
  EXPECT_THAT(refusal({drop(0, 1, {0, 1})}), HasSubstr("dropped as name: counts of 2 stations, of 3"));
  EXPECT_THAT(refusal({drop(0, 1, {0, -1, 0})}), HasSubstr("dropped as name: -1 at a station, 1 in all"));
  EXPECT_THAT(refusal({drop(0, 5, {0, 6, 0})}), HasSubstr("dropped as name: 6 at a station, 5 in all"));
  EXPECT_THAT(refusal({drop(3, 1, {}), drop(3, 1, {})}), HasSubstr("reason 3 is out of order"));
  EXPECT_THAT(refusal({drop(3, 1, {}), drop(2, 1, {})}), HasSubstr("reason 2 is out of order"));
}

MapPromise ValidPromise() {
  return {.terms = {.min_matches = 1, .max_error_m = 0.25, .max_error_deg = 3, .probability = 0.9},
          .model = {.match_ratio = 0, .shape = 1e-9, .error_ratio = 0},
          .nodes = {{0, 3, 0, 0, 0, 0, 1}, {3, 0, 1, 1, 0, 0, 0}},
          .left_out = {{0, 1, 0, 0}, {1, 2, 2, 1}}};
}

std::string PromiseRefusal(const std::function<void(MapPromise*)>& change) {
  MapFindings findings;
  findings.promise = ValidPromise();
  change(&*findings.promise);
  return RefusalOfFindings(findings);
}

TEST(FindingsLimits, PromisesAreOfWhatThereIs) {
  EXPECT_EQ(PromiseRefusal([](MapPromise*) {}), "");
  EXPECT_THAT(PromiseRefusal([](MapPromise* p) { p->terms.min_matches = 0; }),
              HasSubstr("a promise of 0 matches"));
  for (const double bad : {0.0, -1.0, kInfinite, std::nan("")}) {
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->terms.max_error_m = bad; }),
                HasSubstr("a promise of 1 matches"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->terms.max_error_deg = bad; }),
                HasSubstr("a promise of 1 matches"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->model.shape = bad; }),
                HasSubstr("impossible numbers"));
  }
  for (const double bad : {0.0, 1.0, std::nan("")})
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->terms.probability = bad; }),
                HasSubstr("a promise of 1 matches"));
  for (const double bad : {-1e-9, kInfinite, std::nan("")}) {
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->model.match_ratio = bad; }),
                HasSubstr("impossible numbers"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->model.error_ratio = bad; }),
                HasSubstr("impossible numbers"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->radius_m = bad; }), HasSubstr("impossible numbers"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->radius_deg = bad; }), HasSubstr("impossible numbers"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->nodes[1].num_matches = bad; }),
                HasSubstr("a promise of "));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->nodes[1].sigma_m = bad; }),
                HasSubstr("a promise of "));
  }
  EXPECT_THAT(PromiseRefusal([](MapPromise* p) { p->landmarks_lower_bound = -1; }),
              HasSubstr("impossible numbers"));
  const auto node = [](const std::function<void(NodePromise*)>& change) {
    return PromiseRefusal([&](MapPromise* p) { change(&p->nodes[1]); });
  };
  EXPECT_THAT(node([](NodePromise* n) { n->image = 4; }),
              HasSubstr("between images 4 and 0 of 4, in region 1 of 2"));
  EXPECT_THAT(node([](NodePromise* n) { n->image = -1; }), HasSubstr("between images -1 and 0 of 4"));
  EXPECT_THAT(node([](NodePromise* n) { n->other_image = 4; }), HasSubstr("between images 3 and 4 of 4"));
  EXPECT_THAT(node([](NodePromise* n) { n->other_image = -1; }), HasSubstr("between images 3 and -1 of 4"));
  EXPECT_THAT(node([](NodePromise* n) { n->region = 2; }), HasSubstr("in region 2 of 2"));
  EXPECT_THAT(node([](NodePromise* n) { n->region = -1; }), HasSubstr("in region -1 of 2"));
  for (const double bad : {-1e-9, 1 + 1e-9}) {
    EXPECT_THAT(node([&](NodePromise* n) { n->probability = bad; }), HasSubstr("a promise of "));
    EXPECT_THAT(node([&](NodePromise* n) { n->most_probable = bad; }), HasSubstr("a promise of "));
  }
  using Curve = std::vector<PromiseBin>;
  for (const Curve& curve :
       {Curve{{-1e-9, 1, 0, 0}}, Curve{{1 + 1e-9, 1, 0, 0}}, Curve{{0, 1, 0, -1e-9}},
        Curve{{0, 1, 0, 1 + 1e-9}}, Curve{{0, 0, 0, 0}}, Curve{{0, 1, -1, 0}}, Curve{{0, 1, 2, 0}},
        Curve{{0.5, 1, 0, 0}, {0.5, 1, 0, 0}}, Curve{{0.5, 1, 0, 0}, {0.25, 1, 0, 0}}}) {
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->left_out = curve; }), HasSubstr("kept"));
    EXPECT_THAT(PromiseRefusal([&](MapPromise* p) { p->held_out = curve; }), HasSubstr("kept"));
  }
}

TEST(FindingsLimits, PromisesAreKeptFromTheirProbabilityOn) {
  MapPromise promise = ValidPromise();
  promise.nodes[0].probability = 0.9;
  EXPECT_EQ(promise.NumKept(), 2);
  promise.nodes[1].probability = 0.89;
  EXPECT_EQ(promise.NumKept(), 1);
}

std::string ChangeRefusal(const std::function<void(std::vector<MapChange>*)>& change) {
  // Of session 1: what was here is in the next, which is as large; of session 2: a smaller one.
  MapFindings findings;
  findings.changes = {{1, {2e5, -2e5, 0}, 2e5, 3, 0, 3, -1, 1, 3},
                      {1, {0, 0, 0}, 0, 0, 3, -1, 0},
                      {2, {0, 0, 0}, 0, 1, 4, 0, 3}};
  change(&findings.changes);
  return RefusalOfFindings(findings);
}

TEST(FindingsLimits, ChangesAreOfWhatThereIs) {
  using Changes = std::vector<MapChange>;
  EXPECT_EQ(ChangeRefusal([](Changes*) {}), "");
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[0].session = 0; }),
              HasSubstr("change 0 is of session 0 of 3"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].session = 3; }),
              HasSubstr("change 2 is of session 3 of 3"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].image_before = 4; }),
              HasSubstr("change 2 is shown by images 4 and 3 of 4"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].image_after = -2; }),
              HasSubstr("change 2 is shown by images 0 and -2 of 4"));
  const double beyond = 2e5 + 1e-3;
  EXPECT_THAT(ChangeRefusal([&](Changes* c) { (*c)[1].position.y() = beyond; }),
              HasSubstr("change 1: 0 gone and 3 new"));
  EXPECT_THAT(ChangeRefusal([&](Changes* c) { (*c)[1].position.z() = std::nan(""); }),
              HasSubstr("change 1: 0 gone and 3 new"));
  for (const double bad : {-1e-9, beyond, std::nan("")})
    EXPECT_THAT(ChangeRefusal([&](Changes* c) { (*c)[1].radius_m = bad; }),
                HasSubstr("change 1: 0 gone and 3 new"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].num_vanished = -1; }),
              HasSubstr("change 2: -1 gone and 4 new"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].num_appeared = -1, (*c)[2].num_vanished = 5; }),
              HasSubstr("change 2: 5 gone and -1"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[2].num_appeared = (*c)[2].num_vanished = 0; }),
              HasSubstr("change 2: 0 gone and 0"));
  EXPECT_EQ(ChangeRefusal([](Changes* c) { (*c)[2].num_appeared = 0; }), "");
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[1].num_appeared = 4; }),
              HasSubstr("change 1 is out of order"));
  EXPECT_THAT(ChangeRefusal([](Changes* c) { (*c)[1].session = 2, (*c)[2].session = 1; }),
              HasSubstr("out of order"));
  const auto moved = [](int32_t to, int32_t num) {
    return ChangeRefusal([&](Changes* c) { (*c)[0].moved_to = to, (*c)[0].num_moved = num; });
  };
  EXPECT_EQ(moved(0, 1), "");
  EXPECT_EQ(moved(-1, 0), "");
  EXPECT_THAT(moved(-2, 0), HasSubstr("change 0: 0 features of 3 moved to change -2 of 3"));
  EXPECT_THAT(moved(3, 1), HasSubstr("change 0: 1 features of 3 moved to change 3 of 3"));
  EXPECT_THAT(moved(1, 0), HasSubstr("change 0: 0 features"));
  EXPECT_THAT(moved(-1, 1), HasSubstr("change 0: 1 features"));
  EXPECT_THAT(moved(1, -1), HasSubstr("change 0: -1 features"));
  EXPECT_THAT(moved(1, 4), HasSubstr("change 0: 4 features of 3"));
  EXPECT_THAT(moved(2, 1), HasSubstr("change 0: 1 features"));  // of another session
}

TEST(FindingsLimits, MovesAreThoseToAChange) {
  MapFindings findings;
  EXPECT_FALSE(findings.HasMoves());
  findings.changes = {{}, {}};
  EXPECT_FALSE(findings.HasMoves());
  findings.changes[1].moved_to = 0;
  EXPECT_TRUE(findings.HasMoves());
}

}  // namespace
}  // namespace cairn
