#include "core/capture/join_captures.h"

#include <algorithm>
#include <filesystem>
#include <map>
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
  const CaptureSession& first = sessions.front();
  for (const CaptureSession& session : sessions) {
    if (HasPoses(session) == HasPoses(first)) continue;
    const CaptureSession& posed = HasPoses(first) ? first : session;
    const CaptureSession& unposed = HasPoses(first) ? session : first;
    return MakeError(ErrorCode::kInvalidArgument,
                     "'{}' ({}) has poses (images.txt), '{}' ({}) has none: give '{}' poses in the frame of "
                     "'{}', or use folders of images without images.txt for all, so that all are "
                     "reconstructed together",
                     posed.name, posed.root, unposed.name, unposed.root, unposed.name, posed.name);
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

std::string AnchorText(const GeodeticPosition& anchor) {
  return fmt::format("{:.7f}, {:.7f}, {:.2f} m", anchor.latitude_deg, anchor.longitude_deg,
                     anchor.altitude_m);
}

// The frame that all sessions share.
Result<CaptureFrame> JoinFrames(const std::vector<CaptureSession>& sessions,
                                std::vector<std::string>* warnings) {
  std::vector<CaptureFrame> frames;
  for (const CaptureSession& session : sessions) {
    CaptureFrame& frame = frames.emplace_back();
    const std::string path = session.root + "/" + kCaptureFrameFile;
    if (!fs::exists(path)) continue;
    CAIRN_ASSIGN_OR_RETURN(frame, ReadCaptureFrame(path));
  }
  const CaptureSession* anchored = nullptr;
  CaptureFrame joined = frames.front();
  for (size_t i = 0; i < sessions.size(); ++i) {
    if (frames[i].unit != joined.unit) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "'{}' ({}) is in the unit {}, '{}' ({}) in the unit {}: all captures of a map share one frame; "
          "transform the poses of one",
          sessions[0].name, sessions[0].root, joined.unit, sessions[i].name, sessions[i].root,
          frames[i].unit);
    }
    if (frames[i].source != joined.source) joined.source = "mixed";
    joined.is_reconstructed &= frames[i].is_reconstructed;
    // The map is as exact as the worst of them.
    if (frames[i].scale_sigma_ratio > joined.scale_sigma_ratio) {
      joined.scale_sigma_ratio = frames[i].scale_sigma_ratio;
      joined.scale_centre = frames[i].scale_centre;
    }
    if (!frames[i].anchor) continue;
    if (anchored == nullptr) {
      anchored = &sessions[i];
      joined.anchor = frames[i].anchor;
    } else if (AnchorText(*frames[i].anchor) != AnchorText(*joined.anchor)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "the origin of '{}' ({}) is at {}, that of '{}' ({}) at {}: all captures of a map share one "
          "frame; transform the poses of one",
          anchored->name, anchored->root, AnchorText(*joined.anchor), sessions[i].name, sessions[i].root,
          AnchorText(*frames[i].anchor));
    }
  }
  if (!IsMetric(joined) && sessions.size() > 1) {
    warnings->push_back("the captures have no scale; they are taken to be parts of one reconstruction");
  }
  return joined;
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

}  // namespace

Result<JoinedCapture> JoinCaptures(const std::vector<CaptureSession>& sessions, const std::string& folder) {
  CAIRN_RETURN_IF_ERROR(CheckSessions(sessions));
  JoinedCapture joined;
  std::map<CameraId, Camera> cameras;
  std::string images, queries, frame_text;
  if (HasPoses(sessions.front())) {
    std::vector<CameraIds> camera_ids;
    for (const CaptureSession& session : sessions) {
      CAIRN_ASSIGN_OR_RETURN(camera_ids.emplace_back(), AddCameras(session, &cameras));
    }
    const auto no_camera = static_cast<CameraId>(cameras.size() + 1);
    for (size_t i = 0; i < sessions.size(); ++i) {
      CAIRN_RETURN_IF_ERROR(AppendImageList(sessions[i].root + "/images.txt", sessions[i], camera_ids[i],
                                            no_camera, &joined.num_images, &images));
      const std::string list = QueriesOf(sessions[i]);
      if (list.empty()) continue;
      CAIRN_RETURN_IF_ERROR(
          AppendImageList(list, sessions[i], camera_ids[i], no_camera, &joined.num_queries, &queries));
    }
    CAIRN_ASSIGN_OR_RETURN(const CaptureFrame frame, JoinFrames(sessions, &joined.warnings));
    frame_text = CaptureFrameJson(frame);
    if (images.empty()) images = "# no image\n";
  }
  joined.num_cameras = static_cast<int>(cameras.size());
  std::string names;
  for (const CaptureSession& session : sessions)
    names += fmt::format("{} {}\n", session.name, fs::absolute(session.root).lexically_normal().string());

  std::error_code error;
  fs::create_directories(FolderOf(folder), error);
  CAIRN_RETURN_IF_ERROR(
      ReplaceFolderAtomically(folder, "joined captures", [&](const std::string& written) -> Status {
        CAIRN_RETURN_IF_ERROR(LinkImages(sessions, written + "/images"));
        CAIRN_RETURN_IF_ERROR(WriteFileAtomically(written + "/" + kSessionsFile, names));
        if (!HasPoses(sessions.front())) {
          CAIRN_RETURN_IF_ERROR(WriteSessionCameras(sessions, written));
          CAIRN_RETURN_IF_ERROR(WriteSessionImus(sessions, written));
          return WriteSessionOdometry(sessions, written);
        }
        if (!cameras.empty()) CAIRN_RETURN_IF_ERROR(WriteCamerasText(written + "/cameras.txt", cameras));
        for (const auto& [name, text] : {std::pair<const char*, const std::string&>("images.txt", images),
                                         {"queries.txt", queries},
                                         {kCaptureFrameFile, frame_text}}) {
          if (!text.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(written + "/" + name, text));
        }
        return Ok();
      }));
  return joined;
}

}  // namespace cairn
