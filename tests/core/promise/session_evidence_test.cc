#include "core/promise/session_evidence.h"

#include <gtest/gtest.h>

#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

// One image a session, and one of none.
Classes Survey() {
  Classes classes = WallSurvey(4, 1);
  classes.images[0].name = "a/0.png";
  classes.images[1].name = "b/0.png";
  classes.images[2].name = "c/0.png";
  classes.sessions = {"a", "b", "c"};
  AddClass({0, 0, 2}, {1}, 3, &classes);
  return classes;
}

// Pairs of looks: seen by both, by the first, by the second, by none.
void CountPairs(int s, int t, int both, int first, int second, int none, SessionEvidence* evidence) {
  evidence->Count({s, true}, {t, true}, both);
  evidence->Count({s, true}, {t, false}, first);
  evidence->Count({s, false}, {t, true}, second);
  evidence->Count({s, false}, {t, false}, none);
}

TEST(SessionEvidence, OneSessionTellsAllOfItself) {
  Classes classes = Survey();
  classes.sessions.clear();
  SessionEvidence evidence(classes);
  EXPECT_FALSE(evidence.HasSeveral());
  EXPECT_EQ(evidence.SessionOf(0), -1);
  evidence.Learn();
  EXPECT_EQ(evidence.Weight(-1, -1), 1);
  EXPECT_EQ(evidence.There(0, 0), 1);
}

TEST(SessionEvidence, KnowsWhoseImagesAreAndWhatWasThere) {
  Classes classes = Survey();
  classes.classes[0].age.sessions = {{.there = 1}, {.there = 0.25F}};
  const SessionEvidence evidence(classes);
  EXPECT_TRUE(evidence.HasSeveral());
  EXPECT_EQ(evidence.SessionOf(1), 1);
  EXPECT_EQ(evidence.SessionOf(3), -1);
  EXPECT_EQ(evidence.There(0, 1), 0.25);
  EXPECT_EQ(evidence.There(0, 0), 1);
  EXPECT_EQ(evidence.There(0, 2), 1);  // nothing is said
  EXPECT_EQ(evidence.There(0, 3), 1);
  EXPECT_EQ(evidence.Weight(0, 1), 1);  // nothing was learnt
}

// Correlations: within a session 0.8, so r^2 / (1 - r^2) = 16 / 9; between a and b 0.6, 9 / 16; between a and
// c none, between b and c as within one.
TEST(SessionEvidence, WeighsByTheVarianceThatASessionExplains) {
  const Classes classes = Survey();
  SessionEvidence evidence(classes);
  for (int s = 0; s < 3; ++s) CountPairs(s, s, 450000, 50000, 50000, 450000, &evidence);
  CountPairs(0, 1, 400000, 100000, 100000, 400000, &evidence);
  CountPairs(2, 0, 250000, 250000, 250000, 250000, &evidence);
  CountPairs(2, 1, 450000, 50000, 50000, 450000, &evidence);
  evidence.Learn();
  EXPECT_NEAR(evidence.Weight(0, 1), 81.0 / 256, 1e-3);
  EXPECT_EQ(evidence.Weight(1, 0), evidence.Weight(0, 1));
  EXPECT_EQ(evidence.Weight(0, 2), 0.02);  // a little is told by any
  EXPECT_NEAR(evidence.Weight(1, 2), 1, 1e-3);
  EXPECT_EQ(evidence.Weight(0, 0), 1);
  EXPECT_EQ(evidence.Weight(0, -1), 1);
  EXPECT_EQ(evidence.Weight(-1, 0), 1);
}

// More seen by one session than by the other: correlation (30 * 40 - 20 * 10) / sqrt(50 * 50 * 40 * 60).
TEST(SessionEvidence, CountsEachSideOfAPair) {
  const Classes classes = Survey();
  const auto weight = [&](int s, int t, int first, int second) {
    SessionEvidence evidence(classes);
    CountPairs(0, 0, 450000, 50000, 50000, 450000, &evidence);
    CountPairs(s, t, 300000, first, second, 400000, &evidence);
    evidence.Learn();
    return evidence.Weight(0, 1);
  };
  const double squared = 1000.0 * 1000 / (50 * 50 * 40.0 * 60);
  const double expected = squared / (1 - squared) * 9 / 16;
  EXPECT_NEAR(weight(0, 1, 200000, 100000), expected, 1e-3);
  EXPECT_NEAR(weight(1, 0, 100000, 200000), expected, 1e-3);
}

TEST(SessionEvidence, WhatWasHardlyCountedAgreesAsAnyTwoDo) {
  const Classes classes = Survey();
  SessionEvidence evidence(classes);
  CountPairs(0, 0, 450000, 50000, 50000, 450000, &evidence);
  CountPairs(0, 1, 400000, 100000, 100000, 400000, &evidence);
  evidence.Count({1, true}, {2, false}, 1);
  evidence.Count({1, true}, {-1, false}, 1e9);  // of no session
  evidence.Learn();
  EXPECT_NEAR(evidence.Weight(1, 2), 81.0 / 256, 0.03);
  EXPECT_NEAR(evidence.Weight(0, 2), 81.0 / 256, 1e-3);
}

TEST(SessionEvidence, WithoutAnythingSeenTwiceAllTellAll) {
  const Classes classes = Survey();
  SessionEvidence evidence(classes);
  evidence.Count({0, true}, {1, true}, 10);
  evidence.Learn();
  EXPECT_EQ(evidence.Weight(0, 1), 1);
}

}  // namespace
}  // namespace cairn
