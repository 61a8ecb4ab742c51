#include "stages/check_map/promise_figures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/node_poses.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
using testing::SizeIs;
using testing::UnorderedElementsAre;

Pose At(double x, double heading_deg = 0) { return PoseAt({x, 0, 1.2}, heading_deg); }

// Views of 1 m and 10 degrees.  Nodes at x = 0, 10 and 20; between the headings 0 and 60 of the last there
// are two.
MapRows RowsWithPromise() {
  MapRows rows;
  for (const Pose& pose : {At(0), At(10), At(20), At(20, 60)})
    rows.images.push_back({.cam_from_world = pose});
  rows.findings.promise = {.radius_m = 1, .radius_deg = 10};
  rows.findings.promise->nodes = {{.image = 0, .other_image = 0, .probability = 0.99, .most_probable = 0.99},
                                  {.image = 1, .other_image = 1, .probability = 0.95, .most_probable = 0.96},
                                  {.image = 2, .other_image = 2, .probability = 0.3, .most_probable = 0.5},
                                  {.image = 2, .other_image = 3, .probability = 0.98, .most_probable = 1},
                                  {.image = 2, .other_image = 3, .probability = 0.4, .most_probable = 0.99}};
  return rows;
}

HeldOutResult Image(const Pose& truth, std::optional<double> error_m, int num_inliers = 10) {
  HeldOutResult result{.true_cam_from_world = truth};
  result.localization.reason = error_m ? NoFix::kNone : NoFix::kTooFewMatches;
  result.localization.num_inliers = num_inliers;
  result.error_m = error_m.value_or(0);
  return result;
}

TEST(NodePoses, TurnInEqualStepsBetweenTwoImages) {
  const MapRows rows = RowsWithPromise();
  const std::vector<Pose> poses = NodePoses(rows);
  ASSERT_THAT(poses, SizeIs(5));
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(CenterErrorM(poses[i], rows.images[i].cam_from_world), 0, 1e-12);
  EXPECT_NEAR(RotationErrorDeg(poses[3], At(20, 20)), 0, 1e-6);
  EXPECT_NEAR(RotationErrorDeg(poses[4], At(20, 40)), 0, 1e-6);
}

TEST(PromiseOutcomes, AreOfTheNearestNodeWithinItsReach) {
  const MapRows rows = RowsWithPromise();
  const auto outcomes = PromiseOutcomes(
      rows, {Image(At(0.2), 0.05), Image(At(1.49), 0.05), Image(At(1.51), 0.05), Image(At(20, 22), 0.05)});
  ASSERT_THAT(outcomes, SizeIs(3));  // 1.51 m is beyond one and a half radii
  EXPECT_DOUBLE_EQ(outcomes[0].probability, 0.99);
  EXPECT_DOUBLE_EQ(outcomes[1].probability, 0.99);
  EXPECT_DOUBLE_EQ(outcomes[2].probability, 0.98);
  for (const PromiseOutcome& outcome : outcomes) EXPECT_TRUE(outcome.is_kept);
}

TEST(PromiseOutcomes, AreKeptWithinTheTermsAlone) {
  const MapRows rows = RowsWithPromise();
  const auto is_kept = [&](const HeldOutResult& image) { return PromiseOutcomes(rows, {image})[0].is_kept; };
  EXPECT_TRUE(is_kept(Image(At(0), 0.1)));
  EXPECT_FALSE(is_kept(Image(At(0), 0.101)));
  EXPECT_FALSE(is_kept(Image(At(0), std::nullopt)));
  EXPECT_FALSE(is_kept(Image(At(0), 0.05, 9)));
  HeldOutResult turned = Image(At(0), 0.05);
  turned.error_deg = 5.1;
  EXPECT_FALSE(is_kept(turned));
}

TEST(PromiseOutcomes, AreInTheMapsFrame) {
  MapRows rows = RowsWithPromise();
  rows.camera_from_given = At(3).Inverse() * At(0);  // stated poses are elsewhere
  const Pose stated = rows.camera_from_given.Inverse() * At(10);
  EXPECT_DOUBLE_EQ(PromiseOutcomes(rows, {Image(stated, 0)}).at(0).probability, 0.95);
}

TEST(AddPromiseFigures, CountsPromisesOfTheTermsProbability) {
  std::map<std::string, double> figures;
  HeldOutResult unread = Image(At(0), std::nullopt);
  unread.rejected = "truncated";
  AddPromiseFigures(RowsWithPromise(),
                    {Image(At(0), 0.05), Image(At(0), 0.06), Image(At(0), 0.07), Image(At(10), 0.2),
                     Image(At(20), 0.05), Image(At(5), 0.05), unread},
                    &figures);
  EXPECT_THAT(figures,
              UnorderedElementsAre(Pair("num_promised", 4), Pair("num_promised_kept", 3),
                                   Pair("num_beyond_promises", 1), Pair("promised_kept_ratio", 0.75)));
  std::map<std::string, double> none;
  AddPromiseFigures(RowsWithPromise(), {}, &none);
  EXPECT_THAT(none, UnorderedElementsAre(Pair("num_promised", 0), Pair("num_promised_kept", 0),
                                         Pair("num_beyond_promises", 0)));
}

TEST(WhyNotPromised, TellsBudgetMatchesAndAccuracyApart) {
  const MapRows rows = RowsWithPromise();
  MapPromise promise = *rows.findings.promise;
  EXPECT_EQ(WhyNotPromised(promise.nodes[1], promise), "");
  EXPECT_THAT(WhyNotPromised(promise.nodes[4], promise), HasSubstr("max_bytes"));
  EXPECT_THAT(WhyNotPromised(promise.nodes[2], promise), HasSubstr("0 matches are to be expected"));
  promise.nodes[2].num_matches = 1000;
  EXPECT_THAT(WhyNotPromised(promise.nodes[2], promise), HasSubstr("too loosely"));
}

TEST(PromiseText, SaysWhatIsPromisedAndHowItWasKept) {
  MapPromise promise = *RowsWithPromise().findings.promise;
  promise.held_out = {{0.95, 40, 39, 0.97}};
  const std::string text = PromiseText(promise, "m");
  EXPECT_THAT(
      text, HasSubstr("95 % of the images find at least 10 landmarks and are localized within 0.1 m, 5 deg"));
  EXPECT_THAT(text, HasSubstr("1.5 m, 15 deg of one of 5 places and headings; 3 of these keep it"));
  EXPECT_THAT(text, HasSubstr(" 97.0 %  97.5 %  (39 of 40 images)"));
}

}  // namespace
}  // namespace cairn::check_map
