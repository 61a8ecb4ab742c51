#include "stages/link_appearance/contradicted_links.h"

#include <cstdio>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "stages/link_appearance/link_appearance.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// Two doors 5 m apart that look alike, 2 m ahead; images 1 and 2 stand before the first, 3 and 4 before the
// second.  Each door has twelve points, and each image shows those of its door as keypoints 0 to 11.
class TwoDoors : public testing::Test {
 protected:
  TwoDoors() : path_(testing::TempDir() + "/two_doors.db") {
    Camera camera;
    camera.camera_id = 1;
    camera.model = CameraModel::kSimplePinhole;
    camera.width = 640;
    camera.height = 480;
    camera.params = {400, 320, 240};
    classes_.cameras = {camera};
    const double places[] = {0, 0.3, 5, 5.3};
    for (ImageId image_id = 1; image_id <= 4; ++image_id) {
      SurveyImage image{.image_id = image_id, .name = std::to_string(image_id) + ".png", .camera_id = 1};
      image.cam_from_world.translation = {-places[image_id - 1], 0, 0};
      classes_.images.push_back(image);
      images_.images.push_back({image_id, image.name, 1});
    }
    keypoints_.resize(4);
    for (int door = 0; door < 2; ++door) {
      for (int i = 0; i < kNumPoints; ++i) {
        FeatureClass row;
        row.class_id = static_cast<ClassId>(100 * door + i);
        row.position = {5.0 * door + 0.1 * (i % 4), 0.2 * (i / 4) - 0.2, 2};
        for (int of_door = 0; of_door < 2; ++of_door) {
          const SurveyImage& image = classes_.images[2 * door + of_door];
          const Eigen::Vector2d pixel = *ImageFromCamera(camera, image.cam_from_world * row.position);
          const Keypoint keypoint{static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0};
          keypoints_[2 * door + of_door].push_back(keypoint);
          row.observations.push_back({image.image_id, static_cast<KeypointIdx>(i), keypoint});
        }
        classes_.classes.push_back(row);
      }
    }
  }

  void Link(int image1, int image2, int num_matches = kNumPoints) {
    images_.links.push_back({image1 - 1, image2 - 1, num_matches});
  }

  Result<std::vector<char>> Find() {
    std::remove(path_.c_str());
    {
      SQLite::Database database(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      database.exec(kColmapSchema);
      WriteDatabaseCamera(database, classes_.cameras[0]);
      for (size_t i = 0; i < images_.images.size(); ++i) {
        WriteDatabaseImage(database, images_.images[i]);
        Features features{.keypoints = keypoints_[i], .descriptors = {}};
        features.descriptors =
            DescriptorMatrix::Zero(static_cast<Eigen::Index>(keypoints_[i].size()), kSiftDescriptorDim);
        WriteDatabaseFeatures(database, images_.images[i].image_id, features);
      }
      for (const AppearanceLink& link : images_.links) {
        TwoViewGeometry geometry{.image_id1 = images_.images[link.node1].image_id,
                                 .image_id2 = images_.images[link.node2].image_id,
                                 .config = TwoViewConfig::kCalibrated};
        for (KeypointIdx i = 0; i < static_cast<KeypointIdx>(link.num_inliers); ++i)
          geometry.inliers.push_back({i, i});
        WriteDatabaseTwoViewGeometry(database, geometry);
      }
    }
    return FindContradictedLinks(images_, classes_, path_, nullptr);
  }

  // Takes the observations of an image out of some classes.
  void Forget(ImageId image_id, ClassId first, ClassId last) {
    for (FeatureClass& row : classes_.classes) {
      if (row.class_id % 100 < first || row.class_id % 100 > last) continue;
      std::erase_if(row.observations,
                    [&](const Observation& observation) { return observation.image_id == image_id; });
    }
  }

  static constexpr int kNumPoints = 12;
  std::string path_;
  Classes classes_;
  ImageLinks images_;
  std::vector<PooledVector<Keypoint>> keypoints_;  // per image
};

TEST_F(TwoDoors, MatchesFromDoorToDoorContradictWhereTheImagesStand) {
  Link(1, 2);
  Link(1, 3);
  Link(2, 4);
  Link(3, 4);
  EXPECT_THAT(*Find(), ElementsAre(0, 1, 1, 0));
}

// One side is enough: the other door's keypoints are of no class.
TEST_F(TwoDoors, AKeypointOfNoClassIsHeldAgainstTheOthersClass) {
  Link(1, 2);
  Link(1, 3);
  Forget(3, 0, 11);
  Forget(2, 0, 11);
  EXPECT_THAT(*Find(), ElementsAre(0, 1));
  Forget(1, 0, 6);  // five are left
  EXPECT_THAT(*Find(), ElementsAre(0, 1));
  Forget(1, 7, 7);
  EXPECT_THAT(*Find(), ElementsAre(0, 0));  // of four nothing is said
}

TEST_F(TwoDoors, HalfOfTheMatchesMustAgree) {
  Link(1, 2);
  // Of image 2, six and then seven of the twelve keypoints are not where their classes are.
  const auto displace = [&](int i, float by) { keypoints_[1][i].x += by; };
  for (int i = 0; i < 6; ++i) displace(i, 13);  // 2 % of 640 are 12.8
  EXPECT_THAT(*Find(), ElementsAre(0));
  displace(6, 12.5F);
  EXPECT_THAT(*Find(), ElementsAre(0));
  displace(6, 0.5F);
  EXPECT_THAT(*Find(), ElementsAre(1));
}

TEST_F(TwoDoors, ImagesWithoutAPoseAreTakenForWhatTheyAre) {
  Link(1, 3);
  classes_.images.erase(classes_.images.begin() + 2);
  EXPECT_THAT(*Find(), ElementsAre(0));
}

TEST_F(TwoDoors, PointsBehindACameraDoNotAgree) {
  Link(1, 2);
  classes_.images[1].cam_from_world.rotation = Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitY());
  EXPECT_THAT(*Find(), ElementsAre(1));
}

TEST_F(TwoDoors, MatchesOfKeypointsThatDoNotExistAreAnError) {
  Link(1, 2, kNumPoints + 1);
  const auto found = Find();
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(found.error().message, HasSubstr("images 1 and 2 names keypoints 12 and 12"));
  SQLite::Database(path_, SQLite::OPEN_READWRITE).exec("UPDATE two_view_geometries SET data = x'0102'");
  EXPECT_EQ(FindContradictedLinks(images_, classes_, path_, nullptr).error().code, ErrorCode::kCorrupt);
}

TEST_F(TwoDoors, LookAlikesLeadNowhereAndAreConfusable) {
  Link(1, 2);
  Link(1, 3);
  Link(3, 4);
  ASSERT_TRUE(Find().ok());
  ASSERT_TRUE(TellLookAlikes(classes_, path_, nullptr, &images_).ok());
  EXPECT_THAT(images_.links, SizeIs(2));
  ASSERT_THAT(images_.look_alikes, SizeIs(1));
  EXPECT_EQ(images_.look_alikes[0].node2, 2);
  const auto result = LinkAppearance(images_, nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->appearance.graph.num_links(), 2);
  EXPECT_EQ(result->appearance.NumComponents(), 2);
  EXPECT_TRUE(result->look_alikes.AreLinked(0, 2));
  EXPECT_EQ(result->look_alikes.num_links(), 1);
  // Images left out take their look-alikes with them; others keep them under their new numbers.
  EXPECT_THAT(SubsetOf(images_, {1, 1, 0, 1}).look_alikes, IsEmpty());
  EXPECT_EQ(SubsetOf(images_, {1, 0, 1, 1}).look_alikes.at(0).node2, 1);
}

// As views of one node, nodes that are also linked show the same.
TEST_F(TwoDoors, NodesThatAreLinkedAreNoLookAlikes) {
  for (DatabaseImage& image : images_.images)
    image.name = (image.image_id % 2 == 1 ? "a_" : "b_") + std::to_string(image.image_id);
  Link(1, 2);
  Link(2, 3);
  images_.look_alikes = {{0, 3, 20}};
  LinkAppearanceOptions options;
  options.fuse = "name";
  const auto result = LinkAppearance(images_, nullptr, options, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->appearance.graph.num_nodes(), 2);
  EXPECT_EQ(result->look_alikes.num_links(), 0);
}

}  // namespace
}  // namespace cairn::link_appearance
