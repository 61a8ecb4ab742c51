#include "stages/reconstruct/registration/register_sessions.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/camera/panorama.h"
#include "core/capture/sessions.h"
#include "stages/reconstruct/registration/adjust_registered.h"
#include "stages/reconstruct/registration/place_piece.h"
#include "stages/reconstruct/registration/standing_images.h"

namespace cairn::reconstruct {
namespace {

// Errors of matches by the posed images' poses, before anything is adjusted: these may be off by centimetres.
constexpr double kMaxErrorPx = 8;
// A piece of fewer images than this is placed only where each sees so many points.
constexpr int kMinNumImagesTogether = 3, kMinNumInliersAlone = 40;
// Of those images of a piece that have a fix of their own, so many agree with its place.
constexpr double kMinAgreeingRatio = 0.5;
// Matches that agree of an image that supports a place, on average of at most 50: doors and lamps of another
// floor have 18, the same place 44 to 50, also in half the light.
constexpr int kMinMatchesAnImage = 25;
// Where half as many matches agree with another place, the piece may be there as well.
constexpr double kMaxRivalRatio = 0.5;
// Points that an image must see in the end.
constexpr int kMinNumSeenRegistered = 15;
// Each pass joins what the ones before made known.
constexpr int kMaxNumPasses = 4;

// Part of an input: these images, in this order, and what they match with each other.
MapperInput InputOf(const MapperInput& input, const std::vector<int>& images) {
  MapperInput part{.cameras = input.cameras, .images = {}, .keypoints = {}, .geometries = {}};
  std::set<ImageId> ids;
  for (const int i : images) {
    part.images.push_back(input.images[i]);
    part.keypoints.push_back(input.keypoints[i]);
    ids.insert(input.images[i].image_id);
  }
  for (const TwoViewGeometry& geometry : input.geometries) {
    if (ids.contains(geometry.image_id1) && ids.contains(geometry.image_id2))
      part.geometries.push_back(geometry);
  }
  return part;
}

std::vector<ImageMotion> MotionsAmong(const std::vector<ImageMotion>& motions,
                                      const std::vector<int>& images) {
  std::map<int, int> place;
  for (size_t i = 0; i < images.size(); ++i) place.emplace(images[i], static_cast<int>(i));
  std::vector<ImageMotion> part;
  for (const ImageMotion& motion : motions) {
    const auto first = place.find(motion.image1), second = place.find(motion.image2);
    if (first != place.end() && second != place.end())
      part.push_back({first->second, second->second, motion.cam2_from_cam1});
  }
  return part;
}

class Registrar {
 public:
  Registrar(const MapperInput& input, const Capture& capture, const std::vector<ImageMotion>& motions,
            const MapGloballyOptions& options, int num_threads, Progress& progress)
      : input_(input),
        capture_(capture),
        motions_(motions),
        options_(options),
        num_threads_(num_threads),
        progress_(progress),
        posed_{.input = input, .cameras = input.cameras, .cam_from_world = {}} {
    std::map<std::string, Pose> stated;
    for (const CaptureImage& image : capture.images) {
      if (image.cam_from_world) stated.emplace(image.name, *image.cam_from_world);
    }
    for (const std::string& name : capture.registered)
      result_.sessions.push_back({.name = name, .num_images = 0, .num_joined = 0, .num_supported = 0});
    images_of_.resize(capture.registered.size());
    has_large_piece_.resize(capture.registered.size(), false);
    is_large_piece_joined_ = has_large_piece_;
    for (size_t i = 0; i < input.images.size(); ++i) {
      const int session = SessionOfImage(capture.registered, input.images[i].name);
      session_of_.push_back(session);
      if (session >= 0) images_of_[session].push_back(static_cast<int>(i));
      posed_.cam_from_world.push_back(session < 0 ? FindPose(stated, input.images[i].name) : std::nullopt);
      is_held_.push_back(posed_.cam_from_world.back().has_value());
    }
    result_.reasons.resize(input.images.size());
    for (size_t s = 0; s < images_of_.size(); ++s) {
      result_.sessions[s].num_images = static_cast<int>(images_of_[s].size());
      LeaveOutStanding(&images_of_[s]);
    }
  }

  Result<Registration> Register() {
    CAIRN_RETURN_IF_ERROR(CheckCameras());
    for (size_t s = 0; s < images_of_.size(); ++s) CAIRN_RETURN_IF_ERROR(FindPieces(s));
    seen_ = TriangulateSeen(posed_, kMaxErrorPx, num_threads_);
    for (int pass = 0; pass < kMaxNumPasses && !pieces_.empty(); ++pass) {
      if (!PlacePieces()) break;
      progress_.Begin("adjusting what was joined", 4 * AdjustModelOptions().max_num_iterations, "steps");
      seen_ = AdjustRegistered(is_held_, options_, num_threads_, &posed_, progress_);
      progress_.End();
      if (progress_.Cancelled())
        return MakeError(ErrorCode::kCancelled, "stopped while registering sessions");
    }
    DropUnseen();
    Count();
    result_.cameras = std::move(posed_.cameras);
    result_.cam_from_world = std::move(posed_.cam_from_world);
    result_.seen = std::move(seen_);
    return std::move(result_);
  }

 private:
  Status CheckCameras() const {
    for (size_t i = 0; i < input_.images.size(); ++i) {
      if (session_of_[i] < 0 || !ParsePanoramaViewName(input_.images[i].name)) continue;
      return MakeError(
          ErrorCode::kUnsupported,
          "session '{}' has panoramas, and these are not registered to other captures; give it poses in "
          "their frame, or cut it into pinhole views",
          capture_.registered[session_of_[i]]);
    }
    return Ok();
  }

  // Images of a session that repeat another one of it.
  void LeaveOutStanding(std::vector<int>* images) {
    const std::vector<std::optional<RepeatedImage>> repeated = FindStandingImages(input_, *images);
    motions_ = MotionsOfRepeated(motions_, repeated);
    std::erase_if(*images, [&](int i) {
      if (!repeated[i]) return false;
      result_.reasons[i] = fmt::format("shows what {} shows, from the same place: it says nothing more",
                                       input_.images[repeated[i]->image].name);
      return true;
    });
  }

  // The session by itself: pieces that are rigid, and the other images one by one.
  Status FindPieces(size_t session) {
    std::set<int> alone(images_of_[session].begin(), images_of_[session].end());
    const auto add = [&](Piece piece) {
      if (piece.images.empty()) return;
      if (!IsSmall(piece)) has_large_piece_[session] = true;
      for (const int i : piece.images) alone.erase(i);
      pieces_.push_back(std::move(piece));
    };
    Piece own;
    for (const int i : images_of_[session]) {
      const auto pose = capture_.own_poses.find(input_.images[i].name);
      if (pose == capture_.own_poses.end()) continue;
      own.images.push_back(i);
      own.cam_from_piece.push_back(pose->second);
    }
    const bool has_poses = !own.images.empty();
    add(std::move(own));
    if (!has_poses) {
      const std::vector<int>& images = images_of_[session];
      const Result<GlobalMap> map = MapGlobally(InputOf(input_, images), MotionsAmong(motions_, images),
                                                options_, num_threads_, progress_);
      if (!map.ok() && map.error().code != ErrorCode::kNoData) return map.error();
      if (map.ok()) {
        for (const ColmapModel& model : map->models) add(PieceOf(model));
      }
    }
    for (const int i : alone) pieces_.push_back({.images = {i}, .cam_from_piece = {Pose()}});
    return Ok();
  }

  Piece PieceOf(const ColmapModel& model) {
    const std::map<ImageId, int> index = IndexOf(input_);
    Piece piece;
    for (const ModelImage& image : model.images) {
      piece.images.push_back(index.at(image.image_id));
      piece.cam_from_piece.push_back(image.cam_from_world);
    }
    // Of a session's pieces the largest, which is the first, knows its camera best.
    for (const auto& [camera_id, camera] : model.cameras) {
      if (refined_.insert(camera_id).second) posed_.cameras.insert_or_assign(camera_id, camera);
    }
    return piece;
  }

  // Whether any piece was placed.
  bool PlacePieces() {
    std::vector<int> images;
    for (const Piece& piece : pieces_) images.insert(images.end(), piece.images.begin(), piece.images.end());
    std::map<int, ImageFix> fix_of;
    for (ImageFix& fix : FixImages(posed_, seen_, images, kMaxErrorPx, num_threads_)) {
      const int image = fix.image;
      fix_of.emplace(image, std::move(fix));
    }
    std::vector<Piece> left;
    bool has_placed = false;
    for (Piece& piece : pieces_) {
      std::vector<ImageFix> fixes;
      for (const int i : piece.images) fixes.push_back(fix_of.at(i));
      const std::optional<PiecePlace> place = PlacePiece(piece, fixes, {.max_error_px = kMaxErrorPx});
      const int session = session_of_[piece.images[0]];
      std::string reason = WhyNot(piece, fixes, place);
      if (reason.empty() && IsSmall(piece) && has_large_piece_[session] && !is_large_piece_joined_[session])
        reason =
            "the images of its session that are joined with each other are not registered: it alone says "
            "less";
      if (reason.empty() && !IsSmall(piece)) is_large_piece_joined_[session] = true;
      if (place) {
        spdlog::debug(
            "reconstruct: a piece of {} images from {}: {} agree with a place, by {} matches, {} with "
            "another{}{}",
            piece.images.size(), input_.images[piece.images[0]].name, place->num_supported,
            place->num_matches, place->num_matches_elsewhere, reason.empty() ? "" : ": ", reason);
      }
      Piece other = reason.empty() ? PartElsewhere(&piece, fixes, *place) : Piece();
      for (size_t k = 0; k < piece.images.size(); ++k) {
        result_.reasons[piece.images[k]] = reason;
        if (reason.empty())
          posed_.cam_from_world[piece.images[k]] =
              TransformPose(place->world_from_piece, piece.cam_from_piece[k]);
      }
      has_placed |= reason.empty();
      if (!reason.empty()) left.push_back(std::move(piece));
      for (const int i : other.images)
        result_.reasons[i] = "is elsewhere than the images that are joined with it";
      if (!other.images.empty()) left.push_back(std::move(other));
    }
    pieces_ = std::move(left);
    return has_placed;
  }

  // Takes out of a piece what is elsewhere: a drive's piece may be torn where the camera turned on the spot.
  // Images that see enough, but not from here, and those that see nothing and are nearer to them.
  static Piece PartElsewhere(Piece* piece, const std::vector<ImageFix>& fixes, const PiecePlace& place) {
    const int min_num_inliers = PlacePieceOptions().min_num_inliers;
    std::vector<size_t> here, there;
    for (size_t k = 0; k < fixes.size(); ++k) {
      if (place.num_inliers[k] >= min_num_inliers) {
        here.push_back(k);
      } else if (fixes[k].num_inliers() >= min_num_inliers) {
        there.push_back(k);
      }
    }
    const auto distance_to = [&](size_t k, const std::vector<size_t>& others) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const size_t other : others)
        nearest = std::min(nearest, CenterErrorM(piece->cam_from_piece[k], piece->cam_from_piece[other]));
      return nearest;
    };
    Piece kept, part;
    for (size_t k = 0; k < fixes.size(); ++k) {
      Piece& to = distance_to(k, there) < distance_to(k, here) ? part : kept;
      to.images.push_back(piece->images[k]);
      to.cam_from_piece.push_back(piece->cam_from_piece[k]);
    }
    *piece = std::move(kept);
    return part;
  }

  static bool IsSmall(const Piece& piece) {
    return static_cast<int>(piece.images.size()) < kMinNumImagesTogether;
  }

  // Why a piece is not joined at this place; empty: it is.
  static std::string WhyNot(const Piece& piece, const std::vector<ImageFix>& fixes,
                            const std::optional<PiecePlace>& place) {
    const PlacePieceOptions options;
    const int num_images = static_cast<int>(piece.images.size());
    const auto fixed = static_cast<int>(std::count_if(fixes.begin(), fixes.end(), [&](const ImageFix& fix) {
      return fix.num_inliers() >= options.min_num_inliers;
    }));
    int most = 0;
    for (const ImageFix& fix : fixes) most = std::max(most, fix.num_inliers());
    if (!place) {
      return num_images == 1
                 ? fmt::format("sees {} points of the other captures, of {} needed", most,
                               kMinNumInliersAlone)
                 : fmt::format(
                       "of {} images that are joined with it {} see {} points of the other captures from "
                       "places apart",
                       num_images, fixed, options.min_num_inliers);
    }
    if (num_images < kMinNumImagesTogether) {
      const int fewest = *std::min_element(place->num_inliers.begin(), place->num_inliers.end());
      if (fewest < kMinNumInliersAlone)
        return fmt::format("sees {} points of the other captures, of {} needed", fewest, kMinNumInliersAlone);
    } else if (place->num_supported < kMinNumImagesTogether ||
               place->num_supported < kMinAgreeingRatio * fixed) {
      return fmt::format(
          "the {} images that are joined with it contradict each other: {} see the other captures, {} of "
          "them from one place",
          num_images, fixed, place->num_supported);
    }
    if (place->num_matches < kMinMatchesAnImage * place->num_supported) {
      return fmt::format(
          "the {} images that are joined with it see little of the other captures: {} of them {} points "
          "each, of {} "
          "needed",
          num_images, place->num_supported, place->num_matches / place->num_supported, kMinMatchesAnImage);
    }
    if (place->num_matches_elsewhere >= kMaxRivalRatio * place->num_matches) {
      return fmt::format(
          "looks like two places of the other captures: {} matches of the {} images that are joined with "
          "it agree with one, {} with another",
          place->num_matches, num_images, place->num_matches_elsewhere);
    }
    return "";
  }

  void DropUnseen() {
    for (size_t i = 0; i < input_.images.size(); ++i) {
      if (is_held_[i] || !posed_.cam_from_world[i]) continue;
      const auto num_seen =
          std::count_if(seen_.track_of[i].begin(), seen_.track_of[i].end(), [](int t) { return t >= 0; });
      if (num_seen >= kMinNumSeenRegistered) continue;
      posed_.cam_from_world[i].reset();
      result_.reasons[i] =
          fmt::format("sees {} points from where it would be, of {} needed", num_seen, kMinNumSeenRegistered);
    }
  }

  void Count() {
    for (size_t s = 0; s < images_of_.size(); ++s) {
      RegisteredSession& session = result_.sessions[s];
      for (const int i : images_of_[s]) {
        session.num_joined += posed_.cam_from_world[i].has_value();
        session.num_supported +=
            posed_.cam_from_world[i] && NumShared(i) >= PlacePieceOptions().min_num_inliers;
      }
    }
  }

  // Points that an image shares with other sessions' images.
  int NumShared(int image) const {
    int num_shared = 0;
    for (const int t : seen_.track_of[image]) {
      if (t < 0) continue;
      num_shared +=
          std::any_of(seen_.triangulations[t].inliers.begin(), seen_.triangulations[t].inliers.end(),
                      [&](int e) { return session_of_[seen_.tracks[t][e].image_idx] != session_of_[image]; });
    }
    return num_shared;
  }

  const MapperInput& input_;
  const Capture& capture_;
  std::vector<ImageMotion> motions_;
  const MapGloballyOptions& options_;
  int num_threads_;
  Progress& progress_;
  PosedInput posed_;
  SeenPoints seen_;
  std::vector<bool> is_held_;                // per image: its pose is stated
  std::vector<int> session_of_;              // per image; -1: of none that is registered
  std::vector<std::vector<int>> images_of_;  // per session
  std::vector<Piece> pieces_;                // not joined yet; of a session the largest first
  std::set<CameraId> refined_;               // cameras that a session's own map has
  std::vector<bool> has_large_piece_, is_large_piece_joined_;  // per session: of three images or more
  Registration result_;
};

}  // namespace

Result<Registration> RegisterSessions(const MapperInput& input, const Capture& capture,
                                      const std::vector<ImageMotion>& motions,
                                      const MapGloballyOptions& options, int num_threads,
                                      Progress& progress) {
  return Registrar(input, capture, motions, options, num_threads, progress).Register();
}

}  // namespace cairn::reconstruct
