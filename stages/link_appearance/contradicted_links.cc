#include "stages/link_appearance/contradicted_links.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>
#include <utility>

#include "core/base/pooled.h"
#include "core/camera/camera.h"

namespace cairn::link_appearance {
namespace {

constexpr int kMinNumTested = 5;
constexpr double kMaxErrorRatio = 0.02;
constexpr size_t kMaxNumKept = 4096;  // images whose keypoints are kept, some dozen kB each

constexpr char kSelectMatches[] = "SELECT data FROM two_view_geometries WHERE pair_id = ?";

class LinkTester {
 public:
  LinkTester(const Classes& classes, SQLite::Database& database, const std::string& matches_path)
      : classes_(classes),
        database_(database),
        matches_path_(matches_path),
        query_(database, kSelectMatches) {
    CheckKeys(database, kSelectMatches);
    for (const Camera& camera : classes.cameras) cameras_[camera.camera_id] = &camera;
    for (const SurveyImage& image : classes.images) images_[image.image_id].image = &image;
    for (size_t i = 0; i < classes.classes.size(); ++i) {
      for (const Observation& observation : classes.classes[i].observations) {
        const auto image = images_.find(observation.image_id);
        if (image != images_.end())
          image->second.classes.emplace_back(observation.keypoint_idx, static_cast<int32_t>(i));
      }
    }
    for (auto& [image_id, image] : images_) std::sort(image.classes.begin(), image.classes.end());
  }

  Result<bool> IsContradicted(ImageId image_id1, ImageId image_id2) {
    const auto image1 = images_.find(image_id1), image2 = images_.find(image_id2);
    if (image1 == images_.end() || image2 == images_.end()) return false;
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Match> matches, MatchesOf(image_id1, image_id2));
    if (keypoints_.size() + 2 > kMaxNumKept) keypoints_.clear();
    CAIRN_ASSIGN_OR_RETURN(const PooledVector<Keypoint>* keypoints1, KeypointsOf(image_id1));
    CAIRN_ASSIGN_OR_RETURN(const PooledVector<Keypoint>* keypoints2, KeypointsOf(image_id2));
    int num_tested = 0, num_agreeing = 0;
    for (const Match& match : matches) {
      if (match.idx1 >= keypoints1->size() || match.idx2 >= keypoints2->size()) {
        return MakeError(ErrorCode::kCorrupt, "{}: a match of images {} and {} names keypoints {} and {}",
                         matches_path_, image_id1, image_id2, match.idx1, match.idx2);
      }
      const FeatureClass* class1 = ClassOf(image1->second, match.idx1);
      const FeatureClass* class2 = ClassOf(image2->second, match.idx2);
      if (class1 == nullptr && class2 == nullptr) continue;
      ++num_tested;
      num_agreeing +=
          (class1 == nullptr || IsNear(*image2->second.image, *class1, (*keypoints2)[match.idx2])) &&
          (class2 == nullptr || IsNear(*image1->second.image, *class2, (*keypoints1)[match.idx1]));
    }
    return num_tested >= kMinNumTested && 2 * num_agreeing < num_tested;
  }

 private:
  struct PosedImage {
    const SurveyImage* image = nullptr;
    std::vector<std::pair<KeypointIdx, int32_t>> classes;  // ascending
  };

  const FeatureClass* ClassOf(const PosedImage& image, KeypointIdx keypoint) const {
    const auto found =
        std::lower_bound(image.classes.begin(), image.classes.end(), std::pair(keypoint, int32_t{0}));
    if (found == image.classes.end() || found->first != keypoint) return nullptr;
    return &classes_.classes[found->second];
  }

  bool IsNear(const SurveyImage& image, const FeatureClass& feature_class, const Keypoint& keypoint) const {
    const Camera& camera = *cameras_.at(image.camera_id);
    const auto pixel = ImageFromCamera(camera, image.cam_from_world * feature_class.position);
    const double most = kMaxErrorRatio * std::max(camera.width, camera.height);
    return pixel && (*pixel - Eigen::Vector2d(keypoint.x, keypoint.y)).norm() < most;
  }

  Result<std::vector<Match>> MatchesOf(ImageId image_id1, ImageId image_id2) {
    query_.reset();
    query_.bind(1, PairIdFromImageIds(image_id1, image_id2));
    std::vector<Match> matches;
    if (!query_.executeStep()) return matches;
    const SQLite::Column data = query_.getColumn(0);
    if (static_cast<size_t>(data.getBytes()) % sizeof(Match) != 0) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: the matches of images {} and {} take {} bytes, expected {} each", matches_path_,
                       image_id1, image_id2, data.getBytes(), sizeof(Match));
    }
    matches.resize(static_cast<size_t>(data.getBytes()) / sizeof(Match));
    if (!matches.empty()) std::memcpy(matches.data(), data.getBlob(), matches.size() * sizeof(Match));
    return matches;
  }

  Result<const PooledVector<Keypoint>*> KeypointsOf(ImageId image_id) {
    const auto kept = keypoints_.find(image_id);
    if (kept != keypoints_.end()) return &kept->second;
    CAIRN_ASSIGN_OR_RETURN(PooledVector<Keypoint> keypoints, ReadDatabaseKeypoints(database_, image_id));
    return &(keypoints_[image_id] = std::move(keypoints));
  }

  const Classes& classes_;
  SQLite::Database& database_;
  const std::string& matches_path_;
  SQLite::Statement query_;
  std::unordered_map<CameraId, const Camera*> cameras_;
  std::unordered_map<ImageId, PosedImage> images_;
  std::unordered_map<ImageId, PooledVector<Keypoint>> keypoints_;
};

}  // namespace

Result<std::vector<char>> FindContradictedLinks(const ImageLinks& images, const Classes& classes,
                                                const std::string& matches_path, Progress* progress) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<std::vector<char>> {
    LinkTester tester(classes, database, matches_path);
    std::vector<char> contradicted;
    if (progress)
      progress->Begin("hold links against poses", static_cast<int64_t>(images.links.size()), "links");
    for (const AppearanceLink& link : images.links) {
      if (progress && progress->Cancelled())
        return MakeError(ErrorCode::kCancelled, "linking images was stopped");
      CAIRN_ASSIGN_OR_RETURN(
          const bool is_contradicted,
          tester.IsContradicted(images.images[link.node1].image_id, images.images[link.node2].image_id));
      contradicted.push_back(is_contradicted ? 1 : 0);
      if (progress) progress->Advance();
    }
    if (progress) progress->End();
    return contradicted;
  });
}

Status TellLookAlikes(const Classes& classes, const std::string& matches_path, Progress* progress,
                      ImageLinks* images) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<char> contradicted,
                         FindContradictedLinks(*images, classes, matches_path, progress));
  std::vector<AppearanceLink> links;
  for (size_t i = 0; i < contradicted.size(); ++i)
    (contradicted[i] != 0 ? images->look_alikes : links).push_back(images->links[i]);
  images->links = std::move(links);
  return Ok();
}

}  // namespace cairn::link_appearance
