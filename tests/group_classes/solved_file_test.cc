#include "stages/group_classes/adjust/solved_file.h"

#include <filesystem>
#include <functional>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "core/files/file.h"
#include "stages/group_classes/adjust/bundle.h"
#include "stages/group_classes/adjust/bundle_solution.h"
#include "tests/group_classes/circle.h"

namespace cairn::group_classes {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

const ContentHash kOne = {1, 2}, kTwo = {1, 3};

class SolvedFileTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(path_);
    SolvedFile file(path_);
    file.Add(kOne, "one");
    file.Add(kTwo, std::string("t\0o", 3));
  }
  void TearDown() override { fs::remove_all(path_); }

  const std::string path_ = testing::TempDir() + "/solved_file_test.solved";
};

TEST_F(SolvedFileTest, WhatWasAddedIsFoundByTheNextRun) {
  {
    SolvedFile file(path_);
    EXPECT_EQ(file.Find(kOne), "one");
    EXPECT_EQ(file.Find(kTwo), std::string("t\0o", 3));
    EXPECT_FALSE(file.Find({2, 2}).has_value());
    file.Add({2, 2}, "three");
  }
  SolvedFile file(path_);
  EXPECT_EQ(file.Find({2, 2}), "three");
  EXPECT_EQ(file.Find(kOne), "one");
  file.Remove();
  EXPECT_FALSE(fs::exists(path_));
  file.Add(kOne, "one");  // to nowhere
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(SolvedFileTest, EveryCutLeavesWhatIsWholeBeforeIt) {
  const std::string bytes = *ReadFile(path_);
  const size_t record_bytes = 16 + 8 + 3 + 16, head_bytes = bytes.size() - 2 * record_bytes;
  for (size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_TRUE(WriteFileAtomically(path_, bytes.substr(0, size)).ok());
    {
      SolvedFile file(path_);
      EXPECT_EQ(file.Find(kOne).has_value(), size >= head_bytes + record_bytes) << size;
      EXPECT_FALSE(file.Find(kTwo).has_value()) << size;
      file.Add(kTwo, "two");
    }
    EXPECT_EQ(SolvedFile(path_).Find(kTwo), "two") << size;  // behind what was whole
  }
}

TEST_F(SolvedFileTest, NoDamagedByteIsTakenForASolution) {
  const std::string bytes = *ReadFile(path_);
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x40);
    ASSERT_TRUE(WriteFileAtomically(path_, damaged).ok());
    const SolvedFile file(path_);
    EXPECT_FALSE(file.Find(kTwo).has_value()) << i;  // the last one is behind every damage, or damaged
    const auto one = file.Find(kOne);
    EXPECT_TRUE(!one || *one == "one") << i;
  }
}

TEST_F(SolvedFileTest, TwoRunsDoNotShareAFile) {
  SolvedFile first(path_);
  SolvedFile second(path_);
  EXPECT_FALSE(second.Find(kOne).has_value());
  second.Add({5, 5}, "five");
  second.Remove();
  EXPECT_TRUE(fs::exists(path_));
  EXPECT_EQ(first.Find(kOne), "one");
}

TEST_F(SolvedFileTest, WhereThereCanBeNoneNothingIsKept) {
  fs::remove(path_);
  fs::create_directory(path_);
  SolvedFile file(path_);
  file.Add(kOne, "one");
  EXPECT_FALSE(file.Find(kOne).has_value());
  file.Remove();
  EXPECT_TRUE(fs::is_directory(path_));
  SolvedFile nowhere(path_ + "/no/such/folder");
  nowhere.Add(kOne, "one");
}

// What opening it logs.
std::string SaidOf(const std::string& path) {
  std::ostringstream said;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("said", std::make_shared<spdlog::sinks::ostream_sink_st>(said)));
  SolvedFile file(path);
  spdlog::set_default_logger(before);
  return said.str();
}

TEST_F(SolvedFileTest, SaysWhatItTakesOverAndWhyItKeepsNothing) {
  const std::string whole = SaidOf(path_);
  EXPECT_THAT(whole, HasSubstr("goes on where an earlier run stood, after 2 adjustments"));
  EXPECT_THAT(whole, Not(HasSubstr("damaged")));
  const SolvedFile other(path_);
  EXPECT_THAT(SaidOf(path_), HasSubstr("belongs to another run that is going on; a run"));
  EXPECT_THAT(SaidOf(path_ + "/under_a_file"), HasSubstr("cannot be opened: Not a directory; a run"));
  const std::string fresh = path_ + ".fresh";
  EXPECT_EQ(SaidOf(fresh), "");
  // Once it is there it has a head, and nothing to go on from.
  EXPECT_EQ(SaidOf(fresh), "");
  EXPECT_EQ(fs::status(fresh).permissions() & fs::perms::owner_all,
            fs::perms::owner_read | fs::perms::owner_write);
  fs::remove(fresh);
}

BundleProblem Problem() {
  const Camera camera = Lens();
  Circle circle = MakeCircle(camera, camera, 0.5, {0, 1});
  return circle.problem;
}

TEST_F(SolvedFileTest, AdjustmentOfPiecesGoesOnToTheSameBits) {
  BundleOptions options;
  options.num_steps_at_once = 1;
  options.function_tolerance = 1e-12;
  BundleProblem whole = Problem();
  BundleEvidence evidence;
  AdjustBundle(options, &whole, &evidence);
  // Two steps, then stopped.
  {
    SolvedFile file(path_);
    BundleProblem begun = Problem();
    BundleOptions two = options;
    two.max_num_iterations = 2;
    two.solved = &file;
    AdjustBundle(two, &begun, &evidence);
  }
  SolvedFile file(path_);
  options.solved = &file;
  BundleProblem resumed = Problem();
  BundleEvidence again;
  AdjustBundle(options, &resumed, &again);
  for (size_t i = 0; i < whole.images.size(); ++i) {
    EXPECT_EQ(whole.images[i].cam_from_world.translation, resumed.images[i].cam_from_world.translation);
    EXPECT_EQ(whole.images[i].drifted.rotation.coeffs(), resumed.images[i].drifted.rotation.coeffs());
  }
  EXPECT_EQ(whole.points, resumed.points);
  EXPECT_EQ(whole.cameras[0].delta, resumed.cameras[0].delta);
  EXPECT_EQ(whole.camera_from_given.translation, resumed.camera_from_given.translation);
}

TEST_F(SolvedFileTest, WhatIsFoundIsNotSolvedAgain) {
  BundleOptions options;
  for (const bool is_again : {false, true}) {
    const auto num_bytes = fs::file_size(path_);
    SolvedFile file(path_);
    options.solved = &file;
    BundleProblem problem = Problem();
    AdjustBundle(options, &problem, nullptr);
    EXPECT_EQ(fs::file_size(path_) == num_bytes, is_again);
  }
}

TEST_F(SolvedFileTest, SolutionIsReadAsItWasWritten) {
  BundleProblem solved = Problem(), taken = Problem();
  BundleEvidence evidence, found;
  AdjustBundle({}, &solved, &evidence);
  const BundleOutcome outcome = {.has_converged = true, .num_steps = 7, .trust_region_radius = 5e5};
  const std::string bytes = WriteSolution(solved, outcome, &evidence);
  const auto read = ReadSolution(bytes, &taken, &found);
  ASSERT_TRUE(read.has_value());
  EXPECT_TRUE(read->has_converged);
  EXPECT_EQ(read->num_steps, 7);
  EXPECT_EQ(read->trust_region_radius, 5e5);
  EXPECT_EQ(WriteSolution(taken, *read, &found), bytes);
  EXPECT_EQ(found.camera_sigma, evidence.camera_sigma);
  EXPECT_EQ(found.offset_chi_square, evidence.offset_chi_square);
  EXPECT_EQ(found.walk_deg.num_determined, evidence.walk_deg.num_determined);
  // Bytes of a problem of another size are none of this one.
  taken = Problem();
  taken.points.pop_back();
  EXPECT_FALSE(ReadSolution(bytes, &taken, &found).has_value());
  EXPECT_FALSE(ReadSolution(bytes, &taken, nullptr).has_value());
}

TEST_F(SolvedFileTest, ACameraMayHaveNothingFreeAndNoSizeIsBelieved) {
  BundleProblem solved = Problem(), taken = Problem();
  solved.cameras.emplace_back();
  taken.cameras.emplace_back();
  BundleEvidence evidence, found;
  evidence.camera_sigma = {{1, 2}, {}};
  std::string bytes = WriteSolution(solved, {}, &evidence);
  ASSERT_TRUE(ReadSolution(bytes, &taken, &found).has_value());
  EXPECT_EQ(found.camera_sigma, evidence.camera_sigma);
  // The last four bytes are the number of deviations of the second camera.
  bytes.replace(bytes.size() - 4, 4, "\xff\xff\xff\x7f");
  EXPECT_FALSE(ReadSolution(bytes, &taken, &found).has_value());
}

// Numbers are hashed in pieces: a large problem has many of them, and the first counts as the last does.
TEST_F(SolvedFileTest, AllPiecesOfALargeProblemAreInItsHash) {
  BundleProblem problem = Problem();
  const std::vector<BundleProblem::Observation> once = problem.observations;
  for (int times = 1; times < 6; ++times)
    problem.observations.insert(problem.observations.end(), once.begin(), once.end());
  const ContentHash hash = HashBundle({}, problem, false);
  EXPECT_EQ(HashBundle({}, problem, false), hash);
  for (const size_t i : {size_t{0}, problem.observations.size() / 2, problem.observations.size() - 1}) {
    BundleProblem changed = problem;
    changed.observations[i].sigma_px += 1e-9;
    EXPECT_NE(HashBundle({}, changed, false), hash) << i;
  }
}

TEST_F(SolvedFileTest, AllThatASolutionDependsOnIsInItsHash) {
  const BundleProblem problem = Problem();
  const ContentHash hash = HashBundle({}, problem, false);
  EXPECT_EQ(HashBundle({}, problem, false), hash);
  EXPECT_NE(HashBundle({}, problem, true), hash);
  const std::vector<std::function<void(BundleOptions*)>> of_options = {
      [](BundleOptions* o) { o->loss_scale *= 2; }, [](BundleOptions* o) { ++o->max_num_iterations; },
      [](BundleOptions* o) { o->function_tolerance /= 2; },
      [](BundleOptions* o) { o->initial_trust_region_radius *= 2; },
      [](BundleOptions* o) { o->points_follow = true; }};
  for (size_t i = 0; i < of_options.size(); ++i) {
    BundleOptions options;
    of_options[i](&options);
    EXPECT_NE(HashBundle(options, problem, false), hash) << i;
  }
  const std::vector<std::function<void(BundleProblem*)>> of_problem = {
      [](BundleProblem* p) { p->images[1].camera_idx = 1; },
      [](BundleProblem* p) { p->images[1].stated.translation.x() += 1e-9; },
      [](BundleProblem* p) { p->images[1].way_m += 1e-9; },
      [](BundleProblem* p) { p->images[1].dispersion += 1e-9; },
      [](BundleProblem* p) { p->images[1].is_fixed = true; },
      [](BundleProblem* p) { p->images[1].cam_from_world.translation.y() += 1e-9; },
      [](BundleProblem* p) { p->images[1].drifted.rotation.x() += 1e-9; },
      [](BundleProblem* p) { p->observations[3].image_idx ^= 1; },
      [](BundleProblem* p) { p->observations[3].point_idx ^= 1; },
      [](BundleProblem* p) { p->observations[3].ray.normal.x() += 1e-9; },
      [](BundleProblem* p) { p->observations[3].ray.pixel_from_plane(1, 2) += 1e-9; },
      [](BundleProblem* p) { p->observations[3].camera[1].by_param.x() += 1e-9; },
      [](BundleProblem* p) { p->observations[3].camera[1].growth(0, 1) += 1e-9; },
      [](BundleProblem* p) { p->observations[3].sigma_px += 1e-9; },
      [](BundleProblem* p) { p->observations.pop_back(); },
      [](BundleProblem* p) { p->points[2].z() += 1e-9; },
      [](BundleProblem* p) { p->cameras[0].free[1] = 2; },
      [](BundleProblem* p) { p->cameras[0].prior[1] += 1e-9; },
      [](BundleProblem* p) { p->cameras[0].sigma[1] += 1e-9; },
      [](BundleProblem* p) { p->cameras[0].delta[1] += 1e-9; },
      [](BundleProblem* p) { p->cameras[0].difference_prior += 1e-9; },
      [](BundleProblem* p) { p->cameras[0].difference_sigma += 1e-9; },
      [](BundleProblem* p) { p->camera_from_given.translation.x() += 1e-9; },
      [](BundleProblem* p) { p->is_offset_free = !p->is_offset_free; },
      [](BundleProblem* p) { p->offset_sigma_m *= 2; },
      [](BundleProblem* p) { p->offset_sigma_deg *= 2; },
      [](BundleProblem* p) { p->noise.own_m *= 2; },
      [](BundleProblem* p) { p->noise.own_deg *= 2; },
      [](BundleProblem* p) { p->noise.walk_m *= 2; },
      [](BundleProblem* p) { p->noise.walk_deg *= 2; }};
  for (size_t i = 0; i < of_problem.size(); ++i) {
    BundleProblem changed = problem;
    of_problem[i](&changed);
    EXPECT_NE(HashBundle({}, changed, false), hash) << i;
  }
}

TEST_F(SolvedFileTest, CancelledAdjustmentIsNotKept) {
  class StopsAfterTwo : public Progress {
   public:
    void Begin(std::string_view, int64_t, std::string_view) override {}
    void Advance(int64_t num_items) override { num_steps += num_items; }
    void End() override {}
    bool Cancelled() const override { return num_steps >= 2; }
    int64_t num_steps = 0;
  } progress;
  const auto before = fs::file_size(path_);
  SolvedFile file(path_);
  BundleProblem problem = Problem();
  BundleOptions options;
  options.function_tolerance = 1e-15;
  options.solved = &file;
  options.cancel = options.steps = &progress;
  EXPECT_FALSE(AdjustBundle(options, &problem, nullptr));
  EXPECT_EQ(progress.num_steps, 2);  // within a step
  EXPECT_EQ(fs::file_size(path_), before);
}

}  // namespace
}  // namespace cairn::group_classes
