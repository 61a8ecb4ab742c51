#include "stages/reconstruct/view_graph/differences.h"

#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

// A loop that does not close by 3, which is shared out by the inverses of the weights.
TEST(Differences, LeastSquaresShareOutWhatALoopIsWrongBy) {
  const std::vector<Link> links = {{0, 1}, {1, 2}, {0, 2}};
  const Eigen::MatrixXd differences = (Eigen::MatrixXd(3, 2) << 1, -1, 1, -1, 5, -5).finished();
  const Eigen::MatrixXd even = SolveDifferences(3, links, differences, {1, 1, 1});
  ASSERT_EQ(even.rows(), 3);
  ASSERT_EQ(even.cols(), 2);
  EXPECT_TRUE(even.row(0).isZero());
  EXPECT_NEAR(even(1, 0), 2, 1e-12);
  EXPECT_NEAR(even(2, 0), 4, 1e-12);
  EXPECT_NEAR(even(1, 1), -2, 1e-12);
  const Eigen::MatrixXd uneven = SolveDifferences(3, links, differences, {1, 1, 2});
  EXPECT_NEAR(uneven(1, 0), 2.2, 1e-12);
  EXPECT_NEAR(uneven(2, 0), 4.4, 1e-12);
}

TEST(Differences, LinksCountFromEitherEnd) {
  const Eigen::MatrixXd found =
      SolveDifferences(3, {{2, 0}, {2, 1}}, (Eigen::MatrixXd(2, 1) << 4, 1).finished(), {1, 1});
  EXPECT_NEAR(found(2, 0), -4, 1e-12);
  EXPECT_NEAR(found(1, 0), -3, 1e-12);
}

TEST(Differences, NodesThatNothingJoinsAndNoNodesAreZero) {
  EXPECT_TRUE(SolveDifferences(3, {{0, 1}}, Eigen::MatrixXd::Ones(1, 1), {1}).isZero());
  EXPECT_EQ(SolveDifferences(1, {}, Eigen::MatrixXd::Zero(0, 3), {}).rows(), 1);
  EXPECT_EQ(SolveDifferencesRobustly(0, {}, Eigen::MatrixXd::Zero(0, 3)).rows(), 0);
}

// A ring of ten with chords, two of which are far off.
TEST(Differences, WrongOnesHaveNoSayInTheRobustSolution) {
  std::vector<Link> links;
  std::vector<double> differences;
  for (int i = 0; i < 10; ++i) {
    for (const int ahead : {1, 2, 3}) {
      const int to = (i + ahead) % 10;
      links.push_back({i, to, 0.1});
      differences.push_back(0.5 * (to - i));
    }
  }
  differences[4] += 5;
  differences[20] -= 20;
  const Eigen::Map<const Eigen::VectorXd> rows(differences.data(), std::ssize(differences));
  const Eigen::MatrixXd robust = SolveDifferencesRobustly(10, links, rows);
  const Eigen::MatrixXd plain = SolveDifferences(10, links, rows, std::vector<double>(30, 1));
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(robust(i, 0), 0.5 * i, 0.003) << i;
  EXPECT_GT((plain - robust).norm(), 1);
}

// Three that say 0 within 1 against one that says 3 within 0.01.
TEST(Differences, WhatIsSureOutvotesWhatIsNot) {
  const std::vector<Link> links = {{0, 1, 1}, {0, 1, 1}, {0, 1, 1}, {0, 1, 0.01}};
  const Eigen::VectorXd rows = (Eigen::VectorXd(4) << 0, 0, 0, 3).finished();
  EXPECT_NEAR(SolveDifferencesRobustly(2, links, rows)(1, 0), 3, 0.01);
}

// Three that say 0 against one that says 3 and weighs more than they do.
TEST(Differences, WhatWeighsMoreOutvotesWhatIsMore) {
  std::vector<Link> links = {{0, 1, 1, 0.5}, {0, 1, 1, 0.5}, {0, 1, 1, 0.5}, {0, 1, 1, 4}};
  const Eigen::VectorXd rows = (Eigen::VectorXd(4) << 0, 0, 0, 30).finished();
  EXPECT_NEAR(SolveDifferencesRobustly(2, links, rows)(1, 0), 30, 0.1);
  links[3].weight = 0.5;
  EXPECT_NEAR(SolveDifferencesRobustly(2, links, rows)(1, 0), 0, 0.1);
}

}  // namespace
}  // namespace cairn::reconstruct
