#pragma once

#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/options/options.h"
#include "core/world/landmark_model.h"
#include "core/world/visual_map.h"

namespace cairn {

class Map;           // runtime/map/map.h
struct LandmarkSet;  // runtime/map/landmark_set.h
struct Query;        // runtime/localize/measurement.h

// Localization without 3-D points and without a calibration [Sala06 §VI-C: after Sim & Dudek]: the visual map
// has, for every landmark and heading, a model of its place and size in the image as a function of the
// camera's place.  It is opt-in ([emit_map] visual_map = true); runtime/visual_map/visual_estimate.h finds
// the pose.

struct VisualMapOptions {
  // A model counts at the survey's places that see the landmark, and at those within this distance of one, in
  // units of the survey's spacing [Sala06: the poses from which it was seen].  REQUIRES: >= 0
  double extent_spacings = 1;
  // Largest ratio of best to second-best descriptor angle, both ways.  REQUIRES: in (0, 1]
  double visual_max_ratio = 0.85;
  // Largest angle between the descriptors of a match, radians.  REQUIRES: > 0
  double visual_max_angle_rad = 0.7;
  // Memory for models that stay ready for later images (VisualMap::Open), MiB; those of the image at hand
  // come on top.  REQUIRES: >= 0
  int model_budget_mib = 64;
};
OptionTable DescribeOptions(VisualMapOptions* options);

// A keypoint that shows a landmark, in the estimator's form: without a camera.
struct SeenLandmark {
  LandmarkIdx landmark = 0;
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();  // x px, y px, log2 of the scale in px
};

// Where a survey was taken, and with which camera.
struct VisualSurvey {
  std::vector<Eigen::Vector2d> places;  // the pose lattice, each place once; floor frame, metres
  std::vector<Eigen::Vector2d> images;  // where each image of the map was taken
  std::vector<double> heights_m;        // and how high; empty: all at the same height
  int width_px = 0, height_px = 0;      // of the images
  // As CaptureFrame has them (core/capture/capture_frame.h); the centre in the floor frame.
  double scale_sigma_ratio = 0;
  Eigen::Vector2d scale_centre = Eigen::Vector2d::Zero();
};

// Stations closer together than a centimetre are one place.
std::vector<Eigen::Vector2d> DistinctPlaces(const std::vector<Eigen::Vector2d>& stations);

// The visual map of a map, ready to use: immutable to its users, shareable between threads.
class VisualMap {
 public:
  // A model's prediction at a place of the survey.
  struct AtPlace {
    int32_t place = 0;
    Eigen::Vector3d seen;                  // from the image's middle
    Eigen::Matrix<double, 3, 2> gradient;  // d seen / d place, per metre
    Eigen::Vector3d variance;              // of seen
    double rise = 0;                       // d seen.y / d height of the camera, px / m
  };
  struct Model {
    LandmarkIdx landmark = 0;
    int32_t heading = 0;
    LandmarkModel interpolation;
    Eigen::Vector3d sigma;  // as HeadingModel::sigma
    bool predicts_badly = false;
    std::vector<Eigen::Vector2d> sight_places;
    std::vector<AtPlace> extent;  // ascending place
  };

  // All models of a landmark, ascending heading.
  using Models = std::vector<Model>;

  // Reads what all models share, and no model: EstimateVisualPose loads those of the landmarks that an image
  // shows, blocks of them at once, and keeps them within the budget.  The results are those of Load.  Errors:
  // NotFound where the map has no visual map; Corrupt (a camera that it lacks, no station); Io.
  static Result<std::shared_ptr<const VisualMap>> Open(std::shared_ptr<const Map> map,
                                                       const VisualMapOptions& options = {});
  // Loads all models.  Errors: as Open, and Corrupt for sights that make no model.
  static Result<std::shared_ptr<const VisualMap>> Load(const Map& map, const VisualMapOptions& options = {});
  // Without descriptors: Match finds nothing.  Errors: Corrupt (no place, sights that make no model),
  // InvalidArgument.  REQUIRES: the survey has all images of the data
  static Result<std::shared_ptr<const VisualMap>> Make(const VisualMapData& data, VisualSurvey survey,
                                                       const VisualMapOptions& options = {});

  // Where the survey was taken, floor frame, metres: the pose lattice, each place once.
  const std::vector<Eigen::Vector2d>& places() const { return survey_->places; }
  // Median distance from a place to the next.
  double spacing_m() const { return spacing_m_; }
  const std::vector<double>& headings_deg() const { return headings_deg_; }
  // px; where the survey does not say how far a turn moves the image, a guess: 1.2 max(width, height).
  double focal_px() const { return focal_px_; }
  bool has_learnt_focal() const { return has_learnt_focal_; }
  const VisualErrors& errors() const { return errors_; }
  // Standard deviation of the survey's cameras' heights, m.
  double height_sigma_m() const { return height_sigma_m_; }
  // Size of the images that it can localize.
  int image_width_px() const { return survey_->width_px; }
  int image_height_px() const { return survey_->height_px; }
  Eigen::Vector2d middle_px() const { return {0.5 * survey_->width_px, 0.5 * survey_->height_px}; }
  // How far a place on the floor moves where the map's scale is one standard deviation too small, metres.
  Eigen::Vector2d ScaleSigmaAt(const Eigen::Vector2d& position) const {
    return survey_->scale_sigma_ratio * (position - survey_->scale_centre);
  }
  // Variance of a model's prediction at a place: that of left-out sights, growing with the distance from
  // its sights.
  Eigen::Vector3d Variance(const Model& model, const Eigen::Vector2d& position) const;
  int64_t num_landmarks() const { return num_landmarks_; }
  // The models of a landmark; none where they are not loaded.
  const Models& ModelsOf(LandmarkIdx landmark) const;
  // This map with the models of these landmarks, loaded where they are not; it holds them as long as it is
  // used.  For a map that has all models: that map, which must live as long.  Errors: Corrupt (sights that
  // make no model, a damaged block); Io.  REQUIRES: landmarks in [0, num_landmarks())
  Result<std::shared_ptr<const VisualMap>> With(const std::vector<LandmarkIdx>& landmarks) const;
  // Memory of the models that are kept, bytes, approximately.
  int64_t num_model_bytes() const;

  // Matches by mutual nearest descriptors and ratio test with all landmarks of the map, or with these only
  // (ascending), ascending keypoint.  Errors: Unsupported for an image of another size than the survey's; as
  // Map::Landmarks.
  Result<std::vector<SeenLandmark>> Match(const Query& query) const;
  Result<std::vector<SeenLandmark>> MatchAmong(const Query& query,
                                               std::span<const LandmarkIdx> landmarks) const;

 private:
  // Where models come from that are not loaded, and those that are kept.
  struct Source;

  VisualMap() = default;
  static Result<std::shared_ptr<VisualMap>> MakeFrame(const VisualMapData& data, VisualSurvey survey,
                                                      const VisualMapOptions& options);
  static Result<std::shared_ptr<VisualMap>> MakeFull(const VisualMapData& data, VisualSurvey survey,
                                                     const VisualMapOptions& options);
  Result<std::shared_ptr<const Models>> MakeModels(LandmarkIdx landmark,
                                                   const std::vector<HeadingModel>& stored) const;
  Result<std::shared_ptr<const Models>> LoadModels(LandmarkIdx landmark) const;
  void FillExtent(Model* model) const;
  Result<std::vector<SeenLandmark>> MatchWith(const Query& query, const LandmarkSet& landmarks) const;

  VisualMapOptions options_;
  std::shared_ptr<const VisualSurvey> survey_;
  double height_sigma_m_ = 0;
  double spacing_m_ = 0;
  std::vector<double> headings_deg_;
  double focal_px_ = 0;
  bool has_learnt_focal_ = false;
  VisualErrors errors_;
  int64_t num_landmarks_ = 0;
  std::unordered_map<LandmarkIdx, std::shared_ptr<const Models>> models_of_landmark_;
  std::shared_ptr<const LandmarkSet> landmarks_;  // all, where all models are loaded
  std::shared_ptr<Source> source_;                // none where they are
};

}  // namespace cairn
