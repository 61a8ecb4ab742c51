#pragma once

#include <string>

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

// Chooses again which features the regions of a decomposition keep as landmarks: those that together
// determine a camera's pose best.  After any algorithm of decompose_regions: the number of regions, their
// numbers of features and the covered stations stay the same.  Not in [Sala06], whose §VI-C and §VII
// ask for it.
//
// A survey image v in which landmark l was observed gives this information about the camera's pose (left
// perturbation of cam_from_world: rotation in rad, translation in m), by a bearing u = Y / |Y|:
//   I_lv = p_l J' S^-1 J    J = B' [-[Y]x | 1] / |Y|         Y = l in the camera's frame, metres
//                           S = s^2 1 + B' C B / |Y|^2       s = keypoint's error, rad; C = covariance of l
//                                                            in the camera's frame, m^2; B = two unit vectors
//                                                            at right angles to u and to each other
//                           p_l = a^2 / (a^2 + a0^2)         a = angle to the nearest descriptor among the
//                                                            features that the region could have
// and the features L of all regions should maximise
//   sum over images v of  log det (A_0 + sum over l in L, seen in v, of I_lv) - log det A_0
// where A_0 is what a robot knows without landmarks.  The logarithm favours images that have few landmarks,
// in all headings, over those that have many; the determinant favours landmarks spread over the image and
// over depths; S sharp and well triangulated ones; p_l distinctive ones; the sum those that were seen in many
// images.  It is monotone and submodular.  Each region in turn takes, k times, the feature that adds most;
// with min_kept_ratio = 1 this reaches at least half of the largest value, for a lone region at least 1
// - 1/e [Fisher, Nemhauser & Wolsey, "An analysis of approximations for maximizing submodular set functions
// II", 1978].
//
// Large regions leave little choice: an algorithm that makes few regions ends when no more than k features
// are common.  So a region may also take features that only some of its stations see.  It then shrinks to
// these stations, which must be connected and contain, with its neighbourhood, every station that no other
// region covers.
struct ChooseFeaturesOptions {
  // "pose": as above, where the classes are known; "cover": the features that the algorithm found.
  std::string feature_choice = "pose";
  // Smallest part of a region's stations that it keeps when it takes features that not all of them
  // see.  REQUIRES: in [0, 1]
  double min_kept_ratio = 0.5;
  // s, in pixels: standard deviation of a small keypoint's position, and its growth with the keypoint's
  // scale; these and the class's reprojection error add as squares.  REQUIRES: > 0, >= 0
  double keypoint_sigma_px = 0.5;
  double keypoint_sigma_per_scale = 0.2;
  // a0: angle to the nearest other descriptor at which half of the matches survive.  REQUIRES: > 0
  double confusion_angle_rad = 0.4;
  // A_0: standard deviation of the camera's place, m, and of its rotation, degrees.  REQUIRES: > 0
  double rough_sigma_m = 1;
  double rough_sigma_deg = 30;
};
OptionTable DescribeOptions(ChooseFeaturesOptions* options);

// Pure: same input, same result.  O(observations of the features that regions could have); memory for a
// matrix per image and for the world's incidences.  REQUIRES: CheckWorld(world) is ok, and `decomposition` is
// valid for it (CheckRegions).  Errors: InvalidArgument (an option; a world that does not name the classes of
// its features, or names one that does not exist; an observation in an image, or by a camera, that the
// classes lack).
Result<Decomposition> ChooseFeatures(const World& world, const Classes& classes,
                                     const Decomposition& decomposition,
                                     const ChooseFeaturesOptions& options);

}  // namespace cairn::decompose_regions
