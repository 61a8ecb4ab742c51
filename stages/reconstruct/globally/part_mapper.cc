#include "stages/reconstruct/globally/part_mapper.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "stages/reconstruct/globally/agreeing_pieces.h"
#include "stages/reconstruct/globally/free_camera.h"
#include "stages/reconstruct/globally/pair_evidence.h"
#include "stages/reconstruct/globally/part_model.h"
#include "stages/reconstruct/view_graph/average_rotations.h"

namespace cairn::reconstruct {
namespace {

constexpr int kMinTrackLength = 3;
constexpr double kMinAngleDeg = 1;
// Images of a drive that follow each other: a rotation by so many matches, from which the average differs by
// so little, is sure.
constexpr int kMaxSureDistance = 2, kMinSureMatches = 50;
constexpr double kMaxSureErrorDeg = 1;
constexpr int kMinNumTested = 10;  // matches that tell whether a pair agrees with the map

// One after the other, from coarse to fine.
struct Round {
  double accepted_rad;  // pairs that agree with the map so far are taken in; 0: none are
  double max_error_px;  // of what is triangulated
  int num_keypoints;    // of an image that decide; 0: as many as the budget allows
  bool adjust_cameras;
  bool mends;  // a drive that is torn
};
constexpr Round kRounds[] = {{0, 24, 100, false, false},  {0, 12, 120, true, false},
                             {0.2, 12, 120, true, true},  {0.2, 12, 120, true, true},
                             {0.2, 12, 120, true, false}, {0.1, 6, 150, true, false},
                             {0.05, 4, 0, true, false}};
// Rounds up to this one take in no pairs.
constexpr int kLastStartingRound = 1;
// A round that takes in as far as the one before is left out if it would change fewer than this part of the
// pairs.
constexpr double kMinPartAccepted = 0.01;
// Keypoints that decide in the last round: of an image, and of all.
constexpr int kMinNumKeypoints = 250, kMaxNumKeypoints = 1000;
constexpr int kMaxNumObservations = 600000;

// What is held by look-alikes alone is moved before the last round, at most so often.
constexpr int kMaxNumMoved = 8;
// Points this near to each other, over the median depth, may be one.
constexpr double kSameDepthRatio = 0.05;
// Images of a cluster, which look at the same, have on average so many matches with each other.
constexpr double kMinClusterMatches = 40;

}  // namespace

PartMapper::PartMapper(const MapperInput& input, const std::map<CameraId, Camera>& cameras,
                       const MapGloballyOptions& options, int num_threads, std::vector<int> images,
                       std::vector<ViewPair> pairs, std::vector<ImageMotion> motions,
                       const std::vector<int>& backbone, bool is_drive)
    : input_(input),
      options_(options),
      num_threads_(num_threads),
      is_drive_(is_drive),
      images_(std::move(images)),
      pairs_(std::move(pairs)),
      is_accepted_(pairs_.size(), false) {
  for (const int p : backbone) is_accepted_[p] = true;
  problem_.motions = std::move(motions);
  std::set<std::pair<int, int>> measured;
  for (const ImageMotion& motion : problem_.motions)
    measured.insert(std::minmax(motion.image1, motion.image2));
  for (int i = 1; i < static_cast<int>(images_.size()) && is_drive; ++i) {
    if (measured.count({i - 1, i}) == 0) steps_.emplace_back(i - 1, i);
  }
  std::map<CameraId, int> index;
  for (const auto& [camera_id, camera] : cameras) {
    index.emplace(camera_id, static_cast<int>(problem_.cameras.size()));
    problem_.cameras.push_back(FreeOf(camera, options));
  }
  for (const int image : images_) problem_.camera_idx.push_back(index.at(input.images[image].camera_id));
}

int64_t PartMapper::NumSteps() {
  return static_cast<int64_t>(std::size(kRounds)) * AdjustModelOptions().max_num_iterations;
}

std::map<CameraId, Camera> PartMapper::Cameras() const {
  std::map<CameraId, Camera> cameras;
  for (size_t i = 0; i < images_.size(); ++i)
    cameras.insert_or_assign(input_.images[images_[i]].camera_id, CameraOf(static_cast<int>(i)));
  return cameras;
}

double PartMapper::FocalChange() const {
  double largest = 0;
  for (const FreeCamera& camera : problem_.cameras)
    largest = std::max(largest, std::abs(camera.camera.MeanFocal() / camera.stated.MeanFocal() - 1));
  return largest;
}

std::optional<ColmapModel> PartMapper::Map(const std::vector<Eigen::Quaterniond>& rotations,
                                           double max_focal_change_ratio, Progress& progress) {
  KeepRotations(rotations);
  PlaceAlong(rotations, AcceptedWays(rotations));
  MakeTracks();
  // Odometry says where the images of a drive belong.
  const bool may_move = !is_drive_ || problem_.motions.empty();
  for (const Round& round : kRounds) {
    if (progress.Cancelled()) return ColmapModel();
    TriangulateAll(round.max_error_px);
    const bool is_last = &round == std::end(kRounds) - 1;
    for (int k = 0; is_last && may_move && k < kMaxNumMoved && MoveMisplacedPart(); ++k) {
      AgreeAgain(progress);
      if (progress.Cancelled()) return ColmapModel();
      TriangulateAll(round.max_error_px);
    }
    if (round.accepted_rad > 0) {
      const bool is_again = round.accepted_rad == (&round)[-1].accepted_rad;
      const int num_changed = AcceptPairs(round.accepted_rad);
      if (is_again && num_changed < kMinPartAccepted * static_cast<double>(pairs_.size())) {
        progress.Advance(AdjustModelOptions().max_num_iterations);
        continue;
      }
      if (num_changed > 0) {
        if (round.mends && is_drive_ && may_move && IsTorn(Centers(), steps_)) MendDrive();
        MakeTracks();
        TriangulateAll(round.max_error_px);
      }
    }
    int num_keypoints = round.num_keypoints;
    if (num_keypoints == 0)
      num_keypoints = std::clamp(kMaxNumObservations / static_cast<int>(images_.size()), kMinNumKeypoints,
                                 kMaxNumKeypoints);
    Adjust(num_keypoints, round.adjust_cameras, progress);
    if (&round == &kRounds[kLastStartingRound] && FocalChange() > max_focal_change_ratio) return std::nullopt;
  }
  TriangulateAll(std::end(kRounds)[-1].max_error_px);
  return ModelOfPart(input_, images_, problem_, tracks_, triangulations_);
}

void PartMapper::KeepRotations(const std::vector<Eigen::Quaterniond>& rotations) {
  for (size_t p = 0; p < pairs_.size(); ++p) {
    const ViewPair& pair = pairs_[p];
    if (!is_accepted_[p]) continue;
    const bool is_next = is_drive_ && std::abs(pair.image2 - pair.image1) <= kMaxSureDistance;
    problem_.rotations.push_back({pair.image1, pair.image2, pair.cam2_from_cam1.rotation,
                                  is_next && static_cast<int>(pair.matches.size()) >= kMinSureMatches &&
                                      RotationErrorDeg(pair, rotations) <= kMaxSureErrorDeg});
  }
}

Eigen::Vector2d PartMapper::PixelOf(const TrackElement& element) const {
  const Keypoint& keypoint = input_.keypoints[images_[element.image_idx]][element.keypoint_idx];
  return {keypoint.x, keypoint.y};
}

void PartMapper::MakeTracks() {
  std::vector<int> num_keypoints;
  for (const int image : images_) num_keypoints.push_back(static_cast<int>(input_.keypoints[image].size()));
  ScoredMatches matches(num_keypoints);
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (!is_accepted_[p]) continue;
    // Of strong pairs first.
    const auto score = static_cast<int32_t>(1e6 * pairs_[p].strength);
    for (const Match& match : pairs_[p].matches)
      matches.Add({pairs_[p].image1, match.idx1}, {pairs_[p].image2, match.idx2}, score);
  }
  int64_t num_conflicts = 0;
  tracks_ = UnionMatches(std::move(matches), &num_conflicts).value();
  std::erase_if(tracks_, [](const Track& track) { return static_cast<int>(track.size()) < kMinTrackLength; });
  std::stable_sort(tracks_.begin(), tracks_.end(),
                   [](const Track& a, const Track& b) { return a.size() > b.size(); });
  spdlog::debug("reconstruct: {} of {} pairs, {} tracks",
                std::count(is_accepted_.begin(), is_accepted_.end(), true), pairs_.size(), tracks_.size());
}

// Long tracks first, of each those elements whose images have too few keypoints so far, if they are enough
// for a point; `elements`: those of each track that count.
std::vector<PartMapper::Chosen> PartMapper::ChooseTracks(
    int num_keypoints, const std::vector<std::vector<int>>& elements) const {
  std::vector<int> count(images_.size(), 0);
  std::vector<Chosen> chosen;
  for (size_t t = 0; t < tracks_.size(); ++t) {
    Chosen candidate{static_cast<int>(t), {}};
    for (const int e : elements[t]) {
      if (count[tracks_[t][e].image_idx] < num_keypoints) candidate.elements.push_back(e);
    }
    if (static_cast<int>(candidate.elements.size()) < kMinTrackLength) continue;
    for (const int e : candidate.elements) ++count[tracks_[t][e].image_idx];
    chosen.push_back(std::move(candidate));
  }
  return chosen;
}

void PartMapper::KeepSteps(const std::vector<Eigen::Vector3d>& centers) {
  problem_.steps.clear();
  const std::vector<double> lengths = StepLengths(centers, steps_);
  const double typical = lengths.empty() ? 0 : TypicalLength(lengths);
  for (size_t s = 0; s < steps_.size() && typical > 0; ++s)
    problem_.steps.push_back({steps_[s].first, steps_[s].second, lengths[s] / typical});
}

std::vector<Way> PartMapper::AcceptedWays(const std::vector<Eigen::Quaterniond>& rotations) const {
  std::vector<ViewPair> pairs;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (is_accepted_[p]) pairs.push_back(pairs_[p]);
  }
  const auto bearing_of = [&](int image, KeypointIdx keypoint) {
    return BearingFromImage(CameraOf(image), PixelOf({image, keypoint}));
  };
  return WaysBy(rotations, pairs, problem_.motions, steps_, bearing_of, 1 / CameraOf(0).MeanFocal(),
                !is_drive_, num_threads_);
}

void PartMapper::PlaceAlong(const std::vector<Eigen::Quaterniond>& rotations, const std::vector<Way>& ways) {
  const std::vector<Eigen::Vector3d> centers = CentersAlong(static_cast<int>(images_.size()), ways);
  KeepSteps(centers);
  problem_.cam_from_world.clear();
  for (size_t i = 0; i < images_.size(); ++i)
    problem_.cam_from_world.push_back({rotations[i], -(rotations[i] * centers[i])});
}

std::vector<Eigen::Vector3d> PartMapper::Centers() const {
  std::vector<Eigen::Vector3d> centers;
  for (const Pose& pose : problem_.cam_from_world) centers.push_back(pose.Center());
  return centers;
}

// What look-alikes hold elsewhere is moved; where there is no such part, all images are positioned again by
// the ways of all pairs that agree with the map so far.  What was lost where the camera turned on the spot in
// front of little, the scale of all that follows, no adjustment finds again: a track is triangulated where
// most of it agrees, and images that see it from elsewhere have no say.
void PartMapper::MendDrive() {
  if (MoveMisplacedPart()) return;
  spdlog::debug("reconstruct: the drive is torn, finding places anew");
  const std::vector<Eigen::Quaterniond> rotations = Rotations();
  PlaceAlong(rotations, WithStepsOf(Centers(), steps_, AcceptedWays(rotations)));
}

void PartMapper::TriangulateAll(double max_error_px) {
  TriangulateOptions options;
  options.max_reprojection_error_px = max_error_px;
  options.min_triangulation_angle_deg = kMinAngleDeg;
  options.min_num_observations = 2;
  triangulations_.assign(tracks_.size(), {});
  ParallelFor(static_cast<int64_t>(tracks_.size()), num_threads_, [&](int64_t t) {
    std::vector<PosedRay> rays;
    std::vector<int> elements;
    for (size_t e = 0; e < tracks_[t].size(); ++e) {
      const TrackElement& element = tracks_[t][e];
      const auto ray = MakePixelRay(CameraOf(element.image_idx), PixelOf(element));
      if (!ray) continue;
      rays.push_back({problem_.cam_from_world[element.image_idx], *ray});
      elements.push_back(static_cast<int>(e));
    }
    triangulations_[t] = Triangulate(rays, options);
    for (int& inlier : triangulations_[t].inliers) inlier = elements[inlier];
    if (triangulations_[t].outcome != TriangulateOutcome::kOk) triangulations_[t].inliers.clear();
  });
}

std::vector<Eigen::Quaterniond> PartMapper::Rotations() const {
  std::vector<Eigen::Quaterniond> rotations;
  for (const Pose& pose : problem_.cam_from_world) rotations.push_back(pose.rotation);
  return rotations;
}

// Per image and keypoint; -1 where there is no point.
std::vector<std::vector<int>> PartMapper::TracksOfKeypoints() const {
  std::vector<std::vector<int>> track_of(images_.size());
  for (size_t i = 0; i < images_.size(); ++i) track_of[i].assign(input_.keypoints[images_[i]].size(), -1);
  for (size_t t = 0; t < tracks_.size(); ++t) {
    for (const int e : triangulations_[t].inliers)
      track_of[tracks_[t][e].image_idx][tracks_[t][e].keypoint_idx] = static_cast<int>(t);
  }
  return track_of;
}

// A pair agrees with the map where the points of its keypoints in one image are, on the median, seen in the
// other where they match.
int PartMapper::AcceptPairs(double max_error_rad) {
  const std::vector<std::vector<int>> track_of = TracksOfKeypoints();
  const std::vector<Eigen::Quaterniond> rotations = Rotations();
  std::vector<char> verdict(pairs_.size(), 0);
  ParallelFor(static_cast<int64_t>(pairs_.size()), num_threads_, [&](int64_t p) {
    const ViewPair& pair = pairs_[p];
    std::vector<double> errors;
    const auto add = [&](int track, int image, KeypointIdx keypoint) {
      if (track < 0) return;
      const Eigen::Vector3d seen = problem_.cam_from_world[image] * triangulations_[track].position;
      const auto bearing = BearingFromImage(CameraOf(image), PixelOf({image, keypoint}));
      if (bearing) errors.push_back(std::atan2(bearing->cross(seen).norm(), bearing->dot(seen)));
    };
    for (const Match& match : pair.matches) {
      add(track_of[pair.image1][match.idx1], pair.image2, match.idx2);
      add(track_of[pair.image2][match.idx2], pair.image1, match.idx1);
    }
    if (static_cast<int>(errors.size()) < 2 * kMinNumTested) return;
    verdict[p] =
        UpperMedian(errors) <= max_error_rad && RotationErrorDeg(pair, rotations) <= DegFromRad(max_error_rad)
            ? 1
            : -1;
  });
  int num_changed = 0;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    const bool is_accepted = verdict[p] == 0 ? is_accepted_[p] : verdict[p] > 0;
    if (is_accepted != is_accepted_[p]) ++num_changed;
    is_accepted_[p] = is_accepted;
  }
  return num_changed;
}

double PartMapper::MedianDepth() const {
  std::vector<double> depths;
  for (size_t t = 0; t < tracks_.size(); ++t) {
    for (const int e : triangulations_[t].inliers)
      depths.push_back(
          (problem_.cam_from_world[tracks_[t][e].image_idx] * triangulations_[t].position).norm());
  }
  return depths.empty() ? 0 : Median(depths);
}

// Of a drive: images that follow each other and share enough are not parted, whatever speaks against it.
void PartMapper::HoldSteps(std::vector<SignedLink>* links) const {
  for (SignedLink& link : *links) {
    const bool is_next = std::abs(link.image2 - link.image1) <= kMaxSureDistance;
    if (is_next && link.weight >= kMinSureMatches) link.weight = std::numeric_limits<double>::infinity();
  }
}

void PartMapper::Move(const MisplacedPart& part) {
  const Pose move{Eigen::Quaterniond(part.move.linear()), part.move.translation()};
  for (const int i : part.images) problem_.cam_from_world[i] = problem_.cam_from_world[i] * move.Inverse();
}

// Every other pair of a drive closes a cycle with the pairs of images that follow each other, and these do
// not jump from one place to another that looks alike.  So a part that a move would tear from the images
// before or after it, with which it shares matches, was driven into and out of where it is: twins share more
// of space with each other than either does with the way between them.
bool PartMapper::KeepsDrive(const MisplacedPart& part) const {
  std::vector<std::pair<int, int>> joined;
  for (const ViewPair& pair : pairs_) {
    if (is_drive_ && std::abs(pair.image2 - pair.image1) <= kMaxSureDistance)
      joined.emplace_back(pair.image1, pair.image2);
  }
  const std::vector<Eigen::Vector3d> centers = Centers();
  std::vector<Eigen::Vector3d> moved = centers;
  for (const int i : part.images) moved[i] = part.move * moved[i];
  return !IsTornMore(centers, moved, joined);
}

// Whether images were moved that belong elsewhere.
bool PartMapper::MoveMisplacedPart() {
  const int num_images = static_cast<int>(images_.size());
  const double depth = MedianDepth();
  if (!(depth > 0)) return false;
  const std::vector<std::vector<int>> track_of = TracksOfKeypoints();
  const auto point_of = [&](int image, KeypointIdx keypoint) -> const Eigen::Vector3d* {
    const int track = track_of[image][keypoint];
    return track < 0 ? nullptr : &triangulations_[track].position;
  };
  PairEvidence evidence = EvidenceOf(pairs_, is_accepted_, problem_.cam_from_world, point_of);
  const std::vector<std::vector<int>> clusters =
      AgreeingPieces(num_images, evidence.links, kMinClusterMatches);
  if (is_drive_) HoldSteps(&evidence.links);
  const std::optional<MisplacedPart> part =
      FindMisplacedPart(AgreeingPieces(num_images, evidence.links, 0), clusters, evidence,
                        {.tolerance = kSameDepthRatio * depth}, num_threads_,
                        [this](const MisplacedPart& moved) { return KeepsDrive(moved); });
  if (!part) return false;
  spdlog::debug("reconstruct: {} of {} images belong elsewhere: {} cells of space shared there, {} here",
                part->images.size(), num_images, part->num_cells_there, part->num_cells_here);
  Move(*part);
  return true;
}

// With pairs that agree with where images are now; then the last round follows.
void PartMapper::AgreeAgain(Progress& progress) {
  progress.End();
  progress.Begin("images that looked alike moved, finding places again",
                 3 * AdjustModelOptions().max_num_iterations, "steps");
  const std::vector<Eigen::Quaterniond> rotations = Rotations();
  for (const Round* round : {std::end(kRounds) - 3, std::end(kRounds) - 2}) {
    TriangulateAll(round->max_error_px);
    AcceptPairs(round->accepted_rad);
    MakeTracks();
    TriangulateAll(round->max_error_px);
    problem_.rotations.clear();
    KeepRotations(rotations);
    Adjust(round->num_keypoints, round->adjust_cameras, progress);
  }
}

void PartMapper::Adjust(int num_keypoints, bool adjust_cameras, Progress& progress) {
  std::vector<std::vector<int>> elements;
  for (const Triangulation& triangulation : triangulations_) elements.push_back(triangulation.inliers);
  problem_.points.clear();
  problem_.observations.clear();
  for (const Chosen& chosen : ChooseTracks(num_keypoints, elements)) {
    for (const int e : chosen.elements) {
      const TrackElement& element = tracks_[chosen.track][e];
      problem_.observations.push_back(
          {element.image_idx, static_cast<int>(problem_.points.size()), PixelOf(element)});
    }
    problem_.points.push_back(triangulations_[chosen.track].position);
  }
  AdjustModel({.adjust_cameras = adjust_cameras, .num_threads = num_threads_, .progress = &progress},
              &problem_);
}

}  // namespace cairn::reconstruct
