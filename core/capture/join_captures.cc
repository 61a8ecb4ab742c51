#include "core/capture/join_captures.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "core/base/text.h"
#include "core/capture/sessions.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/image_list.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "core/files/output_path.h"
#include "core/files/write_error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Per session: its camera ids -> those of the joined capture.
using CameraIds = std::map<CameraId, CameraId>;

bool HasPoses(const CaptureSession& session) { return fs::exists(session.root + "/images.txt"); }

std::string QueriesOf(const CaptureSession& session) {
  if (!session.queries_path.empty()) return session.queries_path;
  const std::string path = session.root + "/queries.txt";
  return fs::exists(path) ? path : "";
}

Status CheckSessions(const std::vector<CaptureSession>& sessions) {
  if (sessions.empty()) return MakeError(ErrorCode::kInvalidArgument, "no capture to join");
  std::set<std::string> names;
  for (const CaptureSession& session : sessions) {
    if (!IsSessionName(session.name)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "session '{}': a name has 1 to 100 letters, digits, '-', '_' and '.', and does not "
                       "begin with '-' or '.'",
                       session.name);
    }
    if (!names.insert(session.name).second) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "two captures are named '{}'; give each its own name, such as name = \"{}-2\"",
                       session.name, session.name);
    }
    std::error_code error;
    if (!fs::is_directory(session.root, error))
      return MakeError(ErrorCode::kNotFound, "session '{}': {}: no such folder", session.name, session.root);
  }
  for (const CaptureSession& session : sessions) {
    if (HasPoses(session) || QueriesOf(session).empty()) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "'{}': {}: held-out images are given with their poses, but {} has none (no images.txt); "
                     "leave the list out: [reconstruct] hold_out_every holds images out",
                     session.name, QueriesOf(session), session.root);
  }
  return Ok();
}

// Gives the cameras of a session their ids in the joined capture.
Result<CameraIds> AddCameras(const CaptureSession& session, std::map<CameraId, Camera>* joined) {
  CAIRN_ASSIGN_OR_RETURN(const auto cameras, ReadCamerasText(session.root + "/cameras.txt"));
  CameraIds ids;
  for (const auto& [camera_id, camera] : cameras) {
    const auto key = [](const Camera& c) { return std::tie(c.model, c.width, c.height, c.params); };
    const auto equal =
        std::find_if(joined->begin(), joined->end(),
                     [&, wanted = key(camera)](const auto& entry) { return key(entry.second) == wanted; });
    if (equal != joined->end()) {
      ids[camera_id] = equal->first;
      continue;
    }
    Camera renumbered = camera;
    renumbered.camera_id = static_cast<CameraId>(joined->size() + 1);
    ids[camera_id] = renumbered.camera_id;
    joined->emplace(renumbered.camera_id, renumbered);
  }
  return ids;
}

// Appends a session's image list: names with the session's in front, cameras renumbered, the pose's numbers
// as they are written there.  A camera that the session lacks becomes `no_camera`, which the joined capture
// lacks too.
Status AppendImageList(const std::string& path, const CaptureSession& session, const CameraIds& cameras,
                       CameraId no_camera, int* num_images, std::string* text) {
  return VisitImageList(path, [&](const ListedImage& listed) {
    const auto camera = cameras.find(listed.image.camera_id);
    *text +=
        fmt::format("{} {} {} {}/{}\n\n", ++*num_images, listed.pose_text,
                    camera == cameras.end() ? no_camera : camera->second, session.name, listed.image.name);
  });
}

Result<CaptureFrame> FrameOf(const CaptureSession& session) {
  const std::string path = session.root + "/" + kCaptureFrameFile;
  if (!fs::exists(path)) return CaptureFrame();
  return ReadCaptureFrame(path);
}

std::string AnchorText(const GeodeticPosition& anchor) {
  return fmt::format("{:.7f}, {:.7f}, {:.2f} m", anchor.latitude_deg, anchor.longitude_deg,
                     anchor.altitude_m);
}

// How the frame of `other` differs from that of `first`; empty: nothing that is stated does.
std::string FrameDifference(const CaptureFrame& first, const CaptureFrame& other) {
  if (first.unit != other.unit) return fmt::format("is in the unit {}, not {}", other.unit, first.unit);
  if (!first.anchor || !other.anchor || AnchorText(*first.anchor) == AnchorText(*other.anchor)) return "";
  return fmt::format("has its origin at {}, not {}", AnchorText(*other.anchor), AnchorText(*first.anchor));
}

// The frame that these sessions share.
Result<CaptureFrame> JoinFrames(const std::vector<CaptureSession>& sessions,
                                std::vector<std::string>* warnings) {
  std::optional<CaptureFrame> joined;
  for (const CaptureSession& session : sessions) {
    CAIRN_ASSIGN_OR_RETURN(const CaptureFrame frame, FrameOf(session));
    if (!joined) {
      joined = frame;
      continue;
    }
    if (frame.source != joined->source) joined->source = "mixed";
    joined->is_reconstructed &= frame.is_reconstructed;
    // The map is as exact as the worst of them.
    if (frame.scale_sigma_ratio > joined->scale_sigma_ratio) {
      joined->scale_sigma_ratio = frame.scale_sigma_ratio;
      joined->scale_centre = frame.scale_centre;
    }
    if (frame.anchor) joined->anchor = frame.anchor;
  }
  if (!IsMetric(*joined) && sessions.size() > 1)
    warnings->push_back("the captures have no scale; they are taken to be parts of one reconstruction");
  return *joined;
}

// Writes the cameras.txt of sessions without poses that have one.
Status WriteSessionCameras(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  for (const CaptureSession& session : sessions) {
    const std::string given = session.root + "/cameras.txt";
    if (!fs::exists(given)) continue;
    CAIRN_ASSIGN_OR_RETURN(const auto cameras, ReadCamerasText(given));
    const std::string path = SessionCamerasPath(folder, session.name);
    std::error_code error;
    fs::create_directories(FolderOf(path), error);
    CAIRN_RETURN_IF_ERROR(WriteCamerasText(path, cameras));
  }
  return Ok();
}

// Writes what odometry says of sessions without poses, each in a world of its own, where any has it: lines
// with the session's name in front.
Status WriteSessionOdometry(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  std::string joined;
  for (const CaptureSession& session : sessions) {
    const std::string path = session.root + "/" + kOdometryFile;
    if (!fs::exists(path)) continue;
    CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
    for (const std::string_view line : SplitLines(text)) {
      const std::vector<std::string> words = SplitWords(line);
      if (words.empty() || words[0][0] == '#') continue;
      joined += fmt::format("{}/{}\n", session.name, fmt::join(words, " "));
    }
  }
  return joined.empty() ? Ok() : WriteFileAtomically(folder + "/" + kOdometryFile, joined);
}

// Copies the imu.csv of sessions without poses that have one.
Status WriteSessionImus(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  for (const CaptureSession& session : sessions) {
    const std::string given = session.root + "/" + kImuFile;
    if (!fs::exists(given)) continue;
    CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(given));
    const std::string path = SessionImuPath(folder, session.name);
    std::error_code error;
    fs::create_directories(FolderOf(path), error);
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(path, text));
  }
  return Ok();
}

// images/SESSION -> the session's images.
Status LinkImages(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) return WriteError(folder, "the folder cannot be made", error.value());
  for (const CaptureSession& session : sessions) {
    const bool is_flat = !fs::is_directory(session.root + "/images", error);
    const fs::path target =
        fs::absolute(is_flat ? session.root : session.root + "/images").lexically_normal();
    const fs::path link = fs::path(folder) / session.name;
    fs::create_directory_symlink(target, link, error);
    if (error) {
      return WriteError(link.string(), fmt::format("the link to {} cannot be made", target.string()),
                        error.value());
    }
  }
  return Ok();
}

// features/SESSION.db -> the session's features, where it has any.
Status LinkFeatures(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  for (const CaptureSession& session : sessions) {
    const std::string given = session.root + "/" + kFeaturesFile;
    std::error_code error;
    if (!fs::exists(given, error)) continue;
    const std::string link = SessionFeaturesPath(folder, session.name);
    fs::create_directories(FolderOf(link), error);
    const fs::path target = fs::absolute(given).lexically_normal();
    fs::create_symlink(target, link, error);
    if (error) {
      return WriteError(link, fmt::format("the link to {} cannot be made", target.string()), error.value());
    }
  }
  return Ok();
}

Error QueriesOfAnotherFrame(const CaptureSession& session) {
  return MakeError(
      ErrorCode::kInvalidArgument,
      "'{}': {}: held-out images are given with poses in the map's frame, and those of '{}' are in its own: "
      "it is registered to the other captures; leave the list out: [reconstruct] hold_out_every holds "
      "images out",
      session.name, session.queries_path, session.name);
}

// Why sessions are registered that nobody asked to.
Status NoteRegistered(const std::vector<CaptureSession>& sessions, const std::vector<bool>& are_registered,
                      const CaptureFrame& frame, std::vector<std::string>* warnings) {
  for (size_t i = 0; i < sessions.size(); ++i) {
    if (!are_registered[i] || sessions[i].is_registered || !HasPoses(sessions[i])) continue;
    CAIRN_ASSIGN_OR_RETURN(const CaptureFrame own, FrameOf(sessions[i]));
    warnings->push_back(fmt::format("'{}' ({}) {}: it is registered to the other captures by its images",
                                    sessions[i].name, sessions[i].root, FrameDifference(frame, own)));
  }
  return Ok();
}

// What sessions without poses have besides their images.
Status WriteUnposedSessions(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  std::vector<CaptureSession> unposed;
  std::copy_if(sessions.begin(), sessions.end(), std::back_inserter(unposed), std::not_fn(HasPoses));
  CAIRN_RETURN_IF_ERROR(WriteSessionCameras(unposed, folder));
  CAIRN_RETURN_IF_ERROR(WriteSessionImus(unposed, folder));
  return WriteSessionOdometry(unposed, folder);
}

// The lists of a joined capture.
struct SessionLists {
  std::map<CameraId, Camera> cameras;
  std::string images, queries, frame;            // texts; empty: no session has such
  std::map<std::string, std::string> own_poses;  // of sessions that are registered
};

Status CollectLists(const std::vector<CaptureSession>& sessions, const std::vector<bool>& are_registered,
                    SessionLists* lists, JoinedCapture* joined) {
  std::vector<CameraIds> camera_ids(sessions.size());
  std::vector<CaptureSession> in_frame;
  for (size_t i = 0; i < sessions.size(); ++i) {
    joined->num_registered += are_registered[i];
    if (!HasPoses(sessions[i])) continue;
    CAIRN_ASSIGN_OR_RETURN(camera_ids[i], AddCameras(sessions[i], &lists->cameras));
    if (!are_registered[i]) in_frame.push_back(sessions[i]);
  }
  joined->num_cameras = static_cast<int>(lists->cameras.size());
  if (in_frame.empty()) return Ok();
  const auto no_camera = static_cast<CameraId>(lists->cameras.size() + 1);
  for (size_t i = 0; i < sessions.size(); ++i) {
    const CaptureSession& session = sessions[i];
    if (!HasPoses(session)) continue;
    int num_own = 0;
    std::string* text = are_registered[i] ? &lists->own_poses[session.name] : &lists->images;
    CAIRN_RETURN_IF_ERROR(AppendImageList(session.root + "/images.txt", session, camera_ids[i], no_camera,
                                          are_registered[i] ? &num_own : &joined->num_images, text));
    const std::string list = QueriesOf(session);
    if (list.empty()) continue;
    if (are_registered[i]) {
      if (!session.queries_path.empty()) return QueriesOfAnotherFrame(session);
      joined->warnings.push_back(
          fmt::format("{}: not read: '{}' is registered to the other captures, and its held-out images are "
                      "posed in its own frame",
                      list, session.name));
      continue;
    }
    CAIRN_RETURN_IF_ERROR(
        AppendImageList(list, session, camera_ids[i], no_camera, &joined->num_queries, &lists->queries));
  }
  if (lists->images.empty()) lists->images = "# no image\n";
  CAIRN_ASSIGN_OR_RETURN(const CaptureFrame frame, JoinFrames(in_frame, &joined->warnings));
  lists->frame = CaptureFrameJson(frame);
  return NoteRegistered(sessions, are_registered, frame, &joined->warnings);
}

}  // namespace

Result<std::vector<bool>> SessionsToRegister(const std::vector<CaptureSession>& sessions) {
  std::vector<bool> are_registered(sessions.size(), false);
  if (std::none_of(sessions.begin(), sessions.end(), HasPoses)) return are_registered;
  std::optional<CaptureFrame> first;
  for (size_t i = 0; i < sessions.size(); ++i) {
    are_registered[i] = sessions[i].is_registered || !HasPoses(sessions[i]);
    if (are_registered[i]) continue;
    CAIRN_ASSIGN_OR_RETURN(const CaptureFrame frame, FrameOf(sessions[i]));
    if (!first) first = frame;
    if (!first->anchor && first->unit == frame.unit) first->anchor = frame.anchor;
    are_registered[i] = !FrameDifference(*first, frame).empty();
  }
  if (first) return are_registered;
  return MakeError(
      ErrorCode::kInvalidArgument,
      "every capture with poses is to be registered (frame = \"register\"): to which? leave the key "
      "out for the one in whose frame the map shall be");
}

Result<JoinedCapture> JoinCaptures(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  CAIRN_RETURN_IF_ERROR(CheckSessions(sessions));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<bool> are_registered, SessionsToRegister(sessions));
  JoinedCapture joined;
  SessionLists lists;
  CAIRN_RETURN_IF_ERROR(CollectLists(sessions, are_registered, &lists, &joined));
  std::string names, registered;
  for (size_t i = 0; i < sessions.size(); ++i) {
    names +=
        fmt::format("{} {}\n", sessions[i].name, fs::absolute(sessions[i].root).lexically_normal().string());
    if (are_registered[i]) registered += sessions[i].name + "\n";
  }

  std::error_code error;
  fs::create_directories(FolderOf(folder), error);
  CAIRN_RETURN_IF_ERROR(
      ReplaceFolderAtomically(folder, "joined captures", [&](const std::string& written) -> Status {
        CAIRN_RETURN_IF_ERROR(LinkImages(sessions, written + "/images"));
        CAIRN_RETURN_IF_ERROR(LinkFeatures(sessions, written));
        CAIRN_RETURN_IF_ERROR(WriteFileAtomically(written + "/" + kSessionsFile, names));
        CAIRN_RETURN_IF_ERROR(WriteUnposedSessions(sessions, written));
        if (!lists.cameras.empty())
          CAIRN_RETURN_IF_ERROR(WriteCamerasText(written + "/cameras.txt", lists.cameras));
        for (const auto& [name, text] :
             {std::pair<const char*, const std::string&>("images.txt", lists.images),
              {"queries.txt", lists.queries},
              {kCaptureFrameFile, lists.frame},
              {kRegisterFile, registered}}) {
          if (!text.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(written + "/" + name, text));
        }
        for (const auto& [session, text] : lists.own_poses) {
          const std::string path = SessionPosesPath(written, session);
          fs::create_directories(FolderOf(path), error);
          CAIRN_RETURN_IF_ERROR(WriteFileAtomically(path, text));
        }
        return Ok();
      }));
  return joined;
}

}  // namespace cairn
