#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/files/file.h"
#include "core/world/appearance.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// The survey of maps/drive_twins by default options of all other stages, with its poses withheld: images
// alone.
class TwinWings : public testing::Test {
 protected:
  static constexpr double kFirstWingX = 0.9, kSecondWingX = 4.55, kWingWidthM = 1.7, kSpineM = 1.85;

  void SetUp() override {
    const std::string recipe = *ReadFile(CAIRN_SOURCE_DIR "/maps/drive_twins/recipe.toml");
    const size_t begin = recipe.find("[simulate]") + std::string("[simulate]\n").size();
    ASSERT_TRUE(WriteFileAtomically(folder_ / "simulate.toml",
                                    recipe.substr(begin, recipe.find("\n[", begin) - begin) + "\n")
                    .ok());
    const ProgramRun run = RunShell("cairn stage simulate " + (folder_ / "simulate.toml") + " -o " +
                                    (folder_ / "posed") + " --seed 0 --progress none");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    fs::create_directories(folder_ / "bare");
    std::vector<Reject> rejects;
    const std::vector<CaptureImage> images = *ReadImagesText(folder_ / "posed/images.txt", &rejects);
    for (const CaptureImage& image : images) {
      fs::copy_file(folder_ / ("posed/images/" + image.name), folder_ / ("bare/" + image.name));
      wing_of_[image.name] = WingAt(image.cam_from_world->Center());
    }
    std::ofstream(folder_ / "twins.toml") << "name = \"twins\"\n[capture]\npath = \"bare\"\n";
  }

  // 1 or 2; 0 outside of both.
  static int WingAt(const Eigen::Vector3d& place) {
    if (place.y() < kSpineM) return 0;
    if (place.x() > kFirstWingX && place.x() < kFirstWingX + kWingWidthM) return 1;
    return place.x() > kSecondWingX && place.x() < kSecondWingX + kWingWidthM ? 2 : 0;
  }

  TemporaryFolder folder_{"twin_wings_test"};
  std::map<std::string, int> wing_of_;  // by image
};

// Which of two wings an image shows, the images before it tell: no way leads from one into the other, an
// image is as likely of either, and each has twins.
TEST_F(TwinWings, WithoutPosesAreToldApartByTheDriveThroughThem) {
  const ProgramRun run = RunShell("cairn compile " + (folder_ / "twins.toml") + " -o " +
                                  (folder_ / "twins.cairn") + " --until link-appearance --progress none");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto appearance = ReadAppearance(folder_ / "twins.build/appearance.db");
  ASSERT_TRUE(appearance.ok());
  const auto images = *ReadCapture(folder_ / "twins.build/poses");
  EXPECT_GE(images.images.size(), 0.98 * wing_of_.size());
  // Image ids are given in the order of names.
  std::map<ImageId, int> wing_of_id;
  for (const auto& [name, wing] : wing_of_) wing_of_id[static_cast<ImageId>(wing_of_id.size()) + 1] = wing;
  const auto wing = [&](NodeIdx node) { return wing_of_id.at(appearance->nodes[node].images.at(0)); };
  int num_between = 0;
  for (const AppearanceLink& link : appearance->graph.Links())
    num_between += wing(link.node1) * wing(link.node2) == 2 ? 1 : 0;
  EXPECT_EQ(num_between, 0);
  std::vector<double> entropies;
  for (const AppearanceNode& node : appearance->nodes) {
    if (wing_of_id.at(node.images.at(0)) > 0) entropies.push_back(*node.entropy);
  }
  std::nth_element(entropies.begin(), entropies.begin() + entropies.size() / 2, entropies.end());
  EXPECT_NEAR(entropies[entropies.size() / 2], std::log(2), 0.02);
  std::map<NodeIdx, bool> has_twin;
  for (const ConfusablePair& pair : appearance->confusable) {
    if (wing(pair.node1) * wing(pair.node2) == 2) has_twin[pair.node1] = has_twin[pair.node2] = true;
  }
  EXPECT_GT(has_twin.size(), entropies.size() / 2);
}

}  // namespace
}  // namespace cairn
