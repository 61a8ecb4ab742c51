#include "stages/group_classes/persistence/persistence.h"

#include <gtest/gtest.h>

#include "tests/group_classes/scene_over_time.h"

namespace cairn::group_classes {
namespace {

// What a session's images do to what is there.
struct Light {
  double visibility = 0.6;  // of a point in an image
  double spoilt = 0;        // share of points that it cannot see at all
};

// Whether a point is there in a session.
using IsThere = std::function<bool(int session, const Eigen::Vector3d& point)>;

// A wall 6 m wide, 4 m away, passed once a session.
SceneOverTime Wall(const std::vector<Light>& lights, const IsThere& is_there, uint64_t seed = 1,
                   int num_points = 3000) {
  SceneOverTime scene = EmptyScene();
  for (size_t session = 0; session < lights.size(); ++session) {
    for (int i = 0; i < 24; ++i)
      scene.AddImage(static_cast<int>(session), {-3 + 0.25 * i + 0.03 * static_cast<double>(session), 0, 0});
  }
  Random random(seed);
  for (int p = 0; p < num_points; ++p) {
    const Eigen::Vector3d point(random.Uniform(-3, 3), random.Uniform(-1.2, 1.2), 4);
    std::vector<char> is_spoilt;
    for (const Light& light : lights) is_spoilt.push_back(random.Uniform() < light.spoilt);
    scene.AddPoint(
        point,
        [&](int image, const Eigen::Vector3d& at) {
          const int session = scene.session_of_image[image];
          return is_there(session, at) && !is_spoilt[session] ? lights[session].visibility : 0.0;
        },
        &random);
  }
  return scene;
}

bool InPoster(const Eigen::Vector3d& point) { return std::abs(point.x()) < 0.6 && std::abs(point.y()) < 0.6; }
bool AlwaysThere(int, const Eigen::Vector3d&) { return true; }
bool PosterVanishes(int session, const Eigen::Vector3d& point) { return session == 0 || !InPoster(point); }

Persistence Estimate(const SceneOverTime& scene, int num_sessions, int num_threads = 2) {
  return EstimatePersistence(scene.classes, {.session = scene.session_of_image}, num_sessions, num_threads);
}

struct Forgotten {
  int num_gone = 0, num_gone_dropped = 0;
  int num_living = 0, num_living_dropped = 0;
  double GoneRatio() const { return static_cast<double>(num_gone_dropped) / num_gone; }
  double LivingRatio() const { return static_cast<double>(num_living_dropped) / num_living; }
};

// Of the classes that session 0 saw.
Forgotten Count(const SceneOverTime& scene, const Persistence& persistence, const IsThere& is_there,
                int last) {
  Forgotten forgotten;
  for (size_t c = 0; c < scene.classes.classes.size(); ++c) {
    if (persistence.ages[c].sessions[0].num_seen == 0) continue;
    const bool dropped = persistence.ages[c].presence < PersistenceOptions().min_presence;
    const bool there = is_there(last, scene.classes.classes[c].position);
    ++(there ? forgotten.num_living : forgotten.num_gone);
    if (dropped) ++(there ? forgotten.num_living_dropped : forgotten.num_gone_dropped);
  }
  return forgotten;
}

TEST(Persistence, ForgetsAPosterThatWasTakenDownAndNothingElse) {
  const SceneOverTime scene = Wall({{}, {}}, PosterVanishes);
  const Persistence persistence = Estimate(scene, 2);
  const Forgotten forgotten = Count(scene, persistence, PosterVanishes, 1);
  ASSERT_GT(forgotten.num_gone, 200);
  EXPECT_GT(forgotten.GoneRatio(), 0.9);
  EXPECT_LT(forgotten.LivingRatio(), 0.01);
  ASSERT_EQ(persistence.sessions.size(), 2u);
  EXPECT_NEAR(persistence.sessions[1].there_ratio, 1 - 1.44 / 14.4, 0.03);
  EXPECT_NEAR(persistence.sessions[1].yield, 1, 0.15);
}

TEST(Persistence, ForgetsNothingInADarkSessionThatSpoilsTwoOfFive) {
  const SceneOverTime scene = Wall({{}, {.visibility = 0.3, .spoilt = 0.4}}, AlwaysThere);
  const Persistence persistence = Estimate(scene, 2);
  const Forgotten forgotten = Count(scene, persistence, AlwaysThere, 1);
  EXPECT_LT(forgotten.LivingRatio(), 0.01);
  EXPECT_LT(persistence.sessions[1].yield, 0.6);
  EXPECT_GT(persistence.sessions[1].there_ratio, 0.97);
}

TEST(Persistence, TellsAPosterFromTheDark) {
  const SceneOverTime scene = Wall({{}, {.visibility = 0.3, .spoilt = 0.4}}, PosterVanishes);
  const Forgotten forgotten = Count(scene, Estimate(scene, 2), PosterVanishes, 1);
  EXPECT_GT(forgotten.GoneRatio(), 0.7);
  EXPECT_LT(forgotten.LivingRatio(), 0.03);
}

TEST(Persistence, ASessionThatSeesNothingSaysNothing) {
  const SceneOverTime scene = Wall({{}, {.visibility = 0}}, AlwaysThere);
  const Persistence persistence = Estimate(scene, 2);
  for (const ClassAge& age : persistence.ages) EXPECT_GE(age.presence, 0.5);
  EXPECT_EQ(persistence.sessions[1].num_seen, 0);
}

TEST(Persistence, WhereTheLastSessionWasNotNothingIsForgotten) {
  SceneOverTime scene = EmptyScene();
  for (int i = 0; i < 24; ++i) scene.AddImage(0, {-3 + 0.25 * i, 0, 0});
  // Session 1 passes the left half only.
  for (int i = 0; i < 12; ++i) scene.AddImage(1, {-3 + 0.25 * i, 0, 0});
  Random random(6);
  for (int p = 0; p < 2000; ++p) {
    scene.AddPoint(
        {random.Uniform(-3, 6), random.Uniform(-1, 1), 4}, [&](int, const Eigen::Vector3d&) { return 0.6; },
        &random);
  }
  const Persistence persistence = Estimate(scene, 2);
  int num_unseen = 0;
  for (size_t c = 0; c < persistence.ages.size(); ++c) {
    if (scene.classes.classes[c].position.x() < 4.5) continue;
    EXPECT_EQ(persistence.ages[c].sessions[1].expected, 0);
    EXPECT_EQ(persistence.ages[c].presence, 1);
    ++num_unseen;
  }
  EXPECT_GT(num_unseen, 50);
}

TEST(Persistence, WhatIsBackIsThere) {
  const IsThere away_once = [](int session, const Eigen::Vector3d& point) {
    return session != 1 || !InPoster(point);
  };
  const SceneOverTime scene = Wall({{}, {}, {}}, away_once);
  const Persistence persistence = Estimate(scene, 3);
  int num = 0, num_away = 0;
  for (size_t c = 0; c < persistence.ages.size(); ++c) {
    const ClassAge& age = persistence.ages[c];
    if (age.sessions[2].num_seen > 0) EXPECT_EQ(age.presence, 1);
    // That it was away is known all the same.
    if (!InPoster(scene.classes.classes[c].position) || age.sessions[0].num_seen == 0) continue;
    EXPECT_EQ(age.sessions[1].num_seen, 0);
    EXPECT_GT(age.sessions[2].there, 0.9);
    ++num;
    if (age.sessions[1].there < 0.5) ++num_away;
  }
  EXPECT_GT(num, 200);
  EXPECT_GT(num_away, 0.9 * num);
}

TEST(Persistence, AddsUpWhatSessionsSay) {
  // Two glances that say little each: fewer images would be expected to see what is there.
  const std::vector<Light> lights = {{}, {.visibility = 0.06}, {.visibility = 0.06}};
  const SceneOverTime scene = Wall(lights, PosterVanishes, 3);
  const Persistence both = Estimate(scene, 3);
  double sum = 0, sum_of_one = 0;
  int num = 0;
  for (size_t c = 0; c < both.ages.size(); ++c) {
    const ClassAge& age = both.ages[c];
    if (!InPoster(scene.classes.classes[c].position) || age.sessions[0].num_seen == 0) continue;
    sum += age.presence;
    sum_of_one += age.sessions[1].there;
    ++num;
  }
  ASSERT_GT(num, 200);
  EXPECT_LT(sum, 0.9 * sum_of_one);
}

TEST(Persistence, TheOtherSideOfAWallStays) {
  SceneOverTime scene = EmptyScene();
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 24; ++i) {
      const double x = -3 + 0.25 * i;
      scene.AddImage(session, {x, 0, 0});
      scene.AddImage(session, {x, 0, 8.1}, std::numbers::pi);
    }
  }
  Random random(7);
  const auto in_front = [&](int image) { return image % 2 == 0; };
  for (int p = 0; p < 6000; ++p) {
    const bool front = p % 2 == 0;
    scene.AddPoint(
        {random.Uniform(-3, 3), random.Uniform(-1.2, 1.2), front ? 4.0 : 4.1},
        [&](int image, const Eigen::Vector3d& point) {
          if (in_front(image) != front) return 0.0;
          return front && scene.session_of_image[image] == 1 && InPoster(point) ? 0.0 : 0.6;
        },
        &random);
  }
  const Persistence persistence = Estimate(scene, 2);
  int num_gone = 0, num_dropped = 0, num_behind = 0;
  for (size_t c = 0; c < persistence.ages.size(); ++c) {
    const Eigen::Vector3d& point = scene.classes.classes[c].position;
    if (!InPoster(point) || persistence.ages[c].sessions[0].num_seen == 0) continue;
    const bool dropped = persistence.ages[c].presence < 0.5;
    if (point.z() < 4.05) {
      if (dropped) ++num_dropped;
      ++num_gone;
    } else {
      EXPECT_FALSE(dropped) << point.transpose();
      ++num_behind;
    }
  }
  EXPECT_GT(num_gone, 200);
  EXPECT_GT(num_dropped, 0.75 * num_gone);
  EXPECT_GT(num_behind, 200);
}

TEST(Persistence, ForgetsAPlaceOfWhichEverythingWasExchanged) {
  SceneOverTime scene = EmptyScene();
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 72; ++i) scene.AddImage(session, {-9 + 0.25 * i, 0, 0});
  }
  // A third of the way: what was there is not, and as much else is.
  Random random(8);
  for (int p = 0; p < 8000; ++p) {
    const bool is_new = p % 2 == 1;
    const Eigen::Vector3d point(random.Uniform(-9, 9), random.Uniform(-1.2, 1.2), 4);
    if (is_new && point.x() < 3) continue;
    scene.AddPoint(
        point,
        [&](int image, const Eigen::Vector3d& at) {
          if (at.x() < 3) return 0.6;
          return (scene.session_of_image[image] == 1) == is_new ? 0.6 : 0.0;
        },
        &random);
  }
  const Persistence persistence = Estimate(scene, 2);
  const Forgotten forgotten = Count(
      scene, persistence, [](int, const Eigen::Vector3d& point) { return point.x() < 3; }, 1);
  ASSERT_GT(forgotten.num_gone, 1000);
  EXPECT_GT(forgotten.GoneRatio(), 0.95);
  EXPECT_LT(forgotten.LivingRatio(), 0.01);
}

// A poster is taken down, and another hung up beside it.
bool PosterMoves(int session, const Eigen::Vector3d& point) {
  const auto is_in = [&](double x) { return std::abs(point.x() - x) < 0.5 && std::abs(point.y()) < 0.5; };
  return is_in(-2) ? session == 0 : is_in(1.5) ? session > 0 : std::abs(point.x()) > 0.05;
}

TEST(Persistence, OfAMapOnlyItsLandmarksAreKnown) {
  // Session 0 is a map that kept a tenth of what its images saw; nothing changed since.
  Random random(10);
  SceneOverTime scene = EmptyScene();
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 24; ++i) scene.AddImage(session, {-3 + 0.25 * i, 0, 0});
  }
  for (int p = 0; p < 3000; ++p) {
    const bool is_landmark = p % 10 == 0;
    scene.AddPoint(
        {random.Uniform(-3, 3), random.Uniform(-1.2, 1.2), 4},
        [&](int image, const Eigen::Vector3d&) {
          return scene.session_of_image[image] == 1 ? 0.3 : is_landmark ? 0.6 : 0.0;
        },
        &random);
  }
  ImageSessions images{.session = scene.session_of_image};
  for (const int session : images.session) images.shows_landmarks_only.push_back(session == 0);
  const Persistence known = EstimatePersistence(scene.classes, images, 2, 2);
  EXPECT_TRUE(known.changes.empty());
  EXPECT_EQ(known.sessions[0].num_known, 0);
  for (const ClassAge& age : known.ages) EXPECT_GE(age.presence, 0.5);
  // Taken for images, they would say what was not there.
  EXPECT_GT(Estimate(scene, 2).sessions[0].num_known, 1000);
}

TEST(PlaceChanges, AreWhereAPosterWasAndWhereOneIs) {
  const SceneOverTime scene = Wall({{}, {}, {}}, PosterMoves);
  const Persistence persistence = Estimate(scene, 3);
  ASSERT_EQ(persistence.changes.size(), 2u);
  for (const PlaceChange& change : persistence.changes) {
    EXPECT_EQ(change.session, 1);
    EXPECT_NEAR(change.position.y(), 0, 0.1);
    EXPECT_NEAR(change.position.z(), 4, 1e-9);
    EXPECT_NEAR(change.radius_m, 1 / std::sqrt(6.0), 0.06);  // of a square with sides of 1 m
    // Both images see the place: from sessions 0 and 1, from in front of it.
    for (const bool is_after : {false, true}) {
      const ImageId image_id = is_after ? change.image_after : change.image_before;
      ASSERT_GT(image_id, 0u);
      EXPECT_EQ(scene.session_of_image[image_id - 1], is_after ? 1 : 0);
      EXPECT_NEAR(scene.classes.images[image_id - 1].cam_from_world.Center().x(), change.position.x(), 2.1);
    }
  }
  const bool first_is_gone = persistence.changes[0].num_vanished > 0;
  const PlaceChange& gone = persistence.changes[first_is_gone ? 0 : 1];
  const PlaceChange& hung = persistence.changes[first_is_gone ? 1 : 0];
  EXPECT_NEAR(gone.position.x(), -2, 0.1);
  EXPECT_NEAR(hung.position.x(), 1.5, 0.1);
  EXPECT_GT(gone.num_vanished, 150);
  EXPECT_EQ(gone.num_appeared, 0);
  EXPECT_GT(hung.num_appeared, 150);
  EXPECT_EQ(hung.num_vanished, 0);
  EXPECT_GE(persistence.changes[0].num_vanished + persistence.changes[0].num_appeared,
            persistence.changes[1].num_vanished + persistence.changes[1].num_appeared);
}

TEST(PlaceChanges, AreOneWhereOneThingStandsForAnother) {
  SceneOverTime scene = EmptyScene();
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 24; ++i) scene.AddImage(session, {-3 + 0.25 * i, 0, 0});
  }
  Random random(9);
  for (int p = 0; p < 4000; ++p) {
    const bool is_new = p % 4 == 3;
    const Eigen::Vector3d point(random.Uniform(-3, 3), random.Uniform(-1.2, 1.2), 4);
    if (is_new && !InPoster(point)) continue;
    scene.AddPoint(
        point,
        [&](int image, const Eigen::Vector3d& at) {
          return !InPoster(at) || (scene.session_of_image[image] == 1) == is_new ? 0.6 : 0.0;
        },
        &random);
  }
  const Persistence persistence = Estimate(scene, 2);
  ASSERT_EQ(persistence.changes.size(), 1u);
  EXPECT_GT(persistence.changes[0].num_vanished, 200);
  EXPECT_GT(persistence.changes[0].num_appeared, 25);
  EXPECT_LT(persistence.changes[0].position.head<2>().norm(), 0.1);
}

TEST(PlaceChanges, AreNoneInTheDark) {
  const SceneOverTime scene = Wall({{}, {.visibility = 0.3, .spoilt = 0.4}}, AlwaysThere);
  EXPECT_TRUE(Estimate(scene, 2).changes.empty());
}

TEST(PlaceChanges, ComeAndGoByTurns) {
  const IsThere away_once = [](int session, const Eigen::Vector3d& point) {
    return session != 1 || !InPoster(point);
  };
  const Persistence persistence = Estimate(Wall({{}, {}, {}}, away_once), 3);
  ASSERT_EQ(persistence.changes.size(), 2u);
  EXPECT_EQ(persistence.changes[0].session, 1);
  EXPECT_GT(persistence.changes[0].num_vanished, 200);
  EXPECT_EQ(persistence.changes[1].session, 2);
  EXPECT_GT(persistence.changes[1].num_appeared, 200);
}

TEST(Persistence, ABlurredImageIsNoChange) {
  // Session 1 passes twice: all of its images of the second pass, which alone sees the right half, are
  // blurred.
  SceneOverTime scene = EmptyScene();
  for (int i = 0; i < 48; ++i) scene.AddImage(0, {-6 + 0.25 * i, 0, 0});
  for (int i = 0; i < 48; ++i) scene.AddImage(1, {-6 + 0.25 * i, 0, 0});
  Random random(11);
  for (int p = 0; p < 5000; ++p) {
    scene.AddPoint(
        {random.Uniform(-8, 8), random.Uniform(-1.2, 1.2), 4},
        [&](int image, const Eigen::Vector3d&) { return image >= 48 + 24 ? 0.02 : 0.6; }, &random);
  }
  const Persistence persistence = Estimate(scene, 2);
  const Forgotten forgotten = Count(scene, persistence, AlwaysThere, 1);
  EXPECT_LT(forgotten.LivingRatio(), 0.02);
  EXPECT_TRUE(persistence.changes.empty());
}

TEST(Persistence, ClassesAtOnePlaceAreFinite) {
  SceneOverTime scene = Wall({{}, {}}, AlwaysThere, 12, 200);
  for (FeatureClass& feature : scene.classes.classes)
    feature.position = scene.classes.classes.front().position;
  for (const ClassAge& age : Estimate(scene, 2).ages) {
    EXPECT_TRUE(age.presence >= 0 && age.presence <= 1);
    for (const SessionSightings& session : age.sessions)
      EXPECT_TRUE(session.there >= 0 && session.there <= 1);
  }
}

TEST(Persistence, IsTheSameForAnyNumberOfThreadsAndAnyUnit) {
  SceneOverTime scene = Wall({{}, {.visibility = 0.4, .spoilt = 0.2}}, PosterVanishes);
  const Persistence one = Estimate(scene, 2, 1), seven = Estimate(scene, 2, 7);
  // In centimetres.
  for (SurveyImage& image : scene.classes.images) image.cam_from_world.translation *= 128;
  for (FeatureClass& feature : scene.classes.classes) feature.position *= 128;
  const Persistence larger = Estimate(scene, 2);
  for (size_t c = 0; c < one.ages.size(); ++c) {
    ASSERT_EQ(one.ages[c].presence, seven.ages[c].presence);
    ASSERT_EQ(one.ages[c].sessions[1].expected, seven.ages[c].sessions[1].expected);
    ASSERT_NEAR(one.ages[c].presence, larger.ages[c].presence, 1e-3);
  }
}

}  // namespace
}  // namespace cairn::group_classes
