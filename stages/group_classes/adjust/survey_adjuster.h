#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/structure/triangulate.h"
#include "stages/group_classes/adjust/adjust_survey.h"
#include "stages/group_classes/adjust/bundle.h"
#include "stages/group_classes/adjust/camera_models.h"
#include "stages/group_classes/tracks/matched_features.h"
#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

// What all adjustments of a survey have in common; must outlive them.
struct AdjustContext {
  const MatchedFeatures& matched;
  const TriangulateOptions& triangulate;
  const AdjustSurveyOptions& options;
  int num_threads = 1;
  Progress& progress;
  SolvedFile* solved = nullptr;
};

// A survey, or a part of one, as a bundle adjustment, with the cameras that it may find: what learning
// (adjust_survey.cc) and straightening (straighten.h) have in common.
class SurveyAdjuster {
 public:
  SurveyAdjuster(const AdjustContext& context, const std::vector<Track>& tracks, PosedImages* posed);

 protected:
  const std::string& NameOf(int i) const { return context_.matched.images[posed_.feature_idx[i]].name; }

  // Those tracks that decide on poses and cameras.
  void Select(const std::vector<Triangulation>& triangulations);
  // Observations and points of the selected tracks.
  void Fill(const std::vector<Triangulation>& triangulations);
  // The variants' parameters as blocks about the cameras as stated, where `afresh`, or as they are.
  void SetCameras(const std::vector<int>& variants, bool afresh, BundleProblem* problem) const;
  // Adjusts, and takes over poses and cameras.  `evidence` may be null.
  void Adjust(BundleEvidence* evidence);
  std::vector<Triangulation> TriangulateAll(const TriangulateOptions& options) const {
    return TriangulateTracks(context_.matched, tracks_, posed_, options, context_.num_threads);
  }

  AdjustContext context_;
  const std::vector<Track>& tracks_;
  PosedImages& posed_;
  BundleOptions bundle_options_;
  std::vector<std::vector<CameraVariant>> candidates_;  // per camera
  std::vector<int> variants_;                           // per camera: the one taken
  std::vector<Track> selected_;
  std::vector<double> scales_;  // per observation
  BundleProblem problem_;
  BundleEvidence evidence_;
  SurveyFindings findings_;

 private:
  void MakeImages();
  void SetKeypointNoise();
  double FocalGradient(int camera) const;
};

}  // namespace cairn::group_classes
