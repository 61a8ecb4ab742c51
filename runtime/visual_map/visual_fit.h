#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/world/landmark_model.h"

namespace cairn {

// The attitude of a camera at a place relative to the survey's: turned to the left, up, and clockwise,
// radians, and held higher, metres.
struct Turn {
  double left = 0, up = 0, clockwise = 0;
  double higher_m = 0;
};

// A match as one place and heading of the survey sees it; positions relative to the image's middle, px.
struct FitItem {
  Eigen::Vector3d seen;       // in the query
  Eigen::Vector3d predicted;  // with the survey's heading
  Eigen::Vector3d variance;
  double rise = 0;  // d predicted.y / d height of the camera, px / m
  // ln of the odds that it is right, before its error: ((1 - o) / o) * N(0) / U.
  double log_odds = 0;
  int match = -1;  // index of its match
};

struct TurnFitOptions {
  double focal_px = 1;
  double tilt_sigma_rad = 0.03;
  double height_sigma_m = 0.05;
  double max_left_rad = 1;  // either way
};

// ln(1 + odds that it is right), its derivative (probability that it is right): what an item adds to ln p(z).
struct ItemScore {
  double log_ratio = 0;
  double weight = 0;
};
ItemScore ScoreItem(const FitItem& item, const Eigen::Vector3d& error);

// The prediction for a camera that is held higher.
Eigen::Vector3d LiftedPrediction(const FitItem& item, double higher_m);

// The error of an item seen by a camera that is held higher and turned, and d error / d (left, up, clockwise,
// higher).  False where it is out of sight.
bool ItemError(const FitItem& item, const Eigen::Matrix3d& turn, double higher_m, double focal_px,
               Eigen::Vector3d* error, Eigen::Matrix<double, 3, 4>* jacobian);

// d (as seen after the turn) / d predicted; the scale's own change is left out.
Eigen::Matrix3d TurnGradient(const Eigen::Vector3d& predicted, const Eigen::Matrix3d& turn, double focal_px);

// The turn to the left that most items vote for, in bins of 2 degrees; 0 without votes.
double VoteForLeft(const std::vector<FitItem>& items, const TurnFitOptions& options);

// ln of the normalisation of the prior density of turns and heights: headings are uniform over the circle,
// tilt and height normal.
double LogTurnPrior(const TurnFitOptions& options);

// Improves a turn by `num_steps` of iteratively reweighted least squares, and returns ln of the integral over
// turns and heights of the prior times the product of the items' ratios, by Laplace's method.
double FitTurn(const std::vector<FitItem>& items, const TurnFitOptions& options, int num_steps, Turn* turn);

}  // namespace cairn
