#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "runtime/visual_map/visual_estimate.h"
#include "runtime/visual_map/visual_fit.h"

namespace cairn {

// One place and heading of the survey, or a point near a place.
struct VisualHypothesis {
  int32_t place = 0;
  int32_t heading = 0;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // from the place, metres
  Turn turn;
  double log_mass = -std::numeric_limits<double>::infinity();  // unnormalised
};

// A match with a model that extends to a place.
struct VisualTerm {
  int match;
  const VisualMap::Model* model;
  const VisualMap::AtPlace* at;
};

// Errors: InvalidArgument (a landmark that does not exist, a number that is not finite, a bad option).
Status CheckVisualInput(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                        const VisualEstimateOptions& options);

// How well every place and heading of a visual map explains an image, and points around the best ones: the
// parts of p(x | z) of runtime/visual_map/visual_estimate.h.
class VisualSearch {
 public:
  // Keeps references.  `log_prior`: per place of the map.
  VisualSearch(const VisualMap& map, const std::vector<SeenLandmark>& seen,
               const VisualEstimateOptions& options, const std::vector<double>& log_prior);

  // O(matches * places * headings).
  void Run();
  // Adds a point with the mass that the hypotheses of its heading within `reach_m` lack compared
  // with its own.
  void AddMissingMass(VisualHypothesis point, double reach_m);

  // Places and headings, then, from first_point() on, points around the best of them, which these replace.
  const std::vector<VisualHypothesis>& hypotheses() const { return hypotheses_; }
  size_t first_point() const { return first_point_; }
  // ln of a place's mass if no match were right.
  double LogMassWithoutMatches(int32_t place) const;
  const TurnFitOptions& fit() const { return fit_; }

  const std::vector<VisualTerm>& TermsOf(const VisualHypothesis& hypothesis) const;
  // `offset`: from the term's place, metres; `spread_m`: the item stands for points this far around, standard
  // deviation per axis.
  FitItem MakeItem(const VisualTerm& term, const Eigen::Vector2d& offset, double spread_m) const;
  // From the prediction of the term's model at a position.
  FitItem MakeItem(const VisualTerm& term, const LandmarkModel::Prediction& prediction,
                   const Eigen::Vector2d& position) const;

 private:
  // `variance`: of the model plus that of the points that the item stands for.
  FitItem MakeItem(const VisualTerm& term, const Eigen::Vector3d& predicted, const Eigen::Vector3d& variance,
                   double rise) const;
  double LogOdds(const VisualMap::Model& model, const Eigen::Vector3d& variance) const;
  // Fills items_; `spread_m` as MakeItem's.
  void Gather(const VisualHypothesis& hypothesis, double spread_m);
  // Turn and mass by items_; it stands for e^log_share of its place.
  void Fit(double log_share, VisualHypothesis* hypothesis) const;
  void FindTerms();
  void Subdivide();

  const VisualMap& map_;
  const std::vector<SeenLandmark>& seen_;
  const VisualEstimateOptions& options_;
  const std::vector<double>& log_prior_;
  TurnFitOptions fit_;
  std::vector<std::vector<VisualTerm>> terms_;  // per heading and place
  std::vector<VisualHypothesis> hypotheses_;
  size_t first_point_ = 0;
  std::vector<FitItem> items_;  // of the hypothesis being fitted
};

}  // namespace cairn
