#include "core/capture/capture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "core/base/printable.h"
#include "core/base/text.h"
#include "core/capture/exif.h"
#include "core/capture/sessions.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_model.h"
#include "core/colmap/cut_database.h"
#include "core/colmap/image_list.h"
#include "core/files/file.h"
#include "core/files/input_file.h"
#include "core/images/image_file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Relative names of all image files below a folder, ascending.  Links to folders are followed where they are
// a session's.
std::vector<std::string> ListImages(const std::string& folder, const std::vector<std::string>& sessions) {
  std::vector<std::string> names;
  std::vector<std::string> starts = {folder};
  for (const std::string& session : sessions) {
    std::error_code link_error;
    if (fs::is_symlink(folder + "/" + session, link_error)) starts.push_back(folder + "/" + session);
  }
  for (const std::string& start : starts) {
    std::error_code error;
    fs::recursive_directory_iterator it(start, fs::directory_options::skip_permission_denied, error), end;
    for (; !error && it != end; it.increment(error)) {
      std::error_code type_error;  // a broken link does not end the list
      if (it->is_regular_file(type_error) && HasImageSuffix(it->path().string())) {
        names.push_back(it->path().lexically_relative(folder).generic_string());
      }
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

// Whether something of that name exists, even a broken link: it was put there to be read.
bool IsThere(const std::string& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

// Cameras that a capture without poses gives: for all of its images, or for those of single sessions.
struct KnownCameras {
  struct List {
    std::string path;
    std::map<CameraId, Camera> cameras;
  };
  std::optional<List> of_all;
  std::map<int, List> of_session;

  // Cameras that may have taken the images of a session (-1: of no session); null where none are known.
  const List* Of(int session) const {
    if (const auto found = of_session.find(session); found != of_session.end()) return &found->second;
    return of_all ? &*of_all : nullptr;
  }
};

// `are_of_all`: cameras.txt is of images without poses, too.
Result<KnownCameras> ReadKnownCameras(const std::string& root, const std::vector<std::string>& sessions,
                                      bool are_of_all) {
  KnownCameras known;
  if (const std::string path = root + "/cameras.txt"; are_of_all && IsThere(path)) {
    CAIRN_ASSIGN_OR_RETURN(auto cameras, ReadCamerasText(path));
    known.of_all = {path, std::move(cameras)};
  }
  for (size_t i = 0; i < sessions.size(); ++i) {
    const std::string path = SessionCamerasPath(root, sessions[i]);
    if (!IsThere(path)) continue;
    CAIRN_ASSIGN_OR_RETURN(auto cameras, ReadCamerasText(path));
    known.of_session[static_cast<int>(i)] = {path, std::move(cameras)};
  }
  return known;
}

// The camera of an image of this size; null: no camera has this size.  Errors: InvalidArgument (several have
// this size and differ).
Result<const Camera*> CameraOfSize(const KnownCameras::List& list, const std::string& name, int width,
                                   int height) {
  const Camera* found = nullptr;
  for (const auto& [camera_id, camera] : list.cameras) {
    if (camera.width != width || camera.height != height) continue;
    if (found == nullptr) found = &camera;
    if (camera.model == found->model && camera.params == found->params) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: cameras {} and {} are both {} x {}, and without images.txt nothing tells which of "
                     "them took {}; leave one camera of each size, or make each camera's images a capture of "
                     "its own and name them all in the recipe",
                     list.path, found->camera_id, camera_id, width, height, name);
  }
  return found;
}

// Gives the images of a capture without poses their cameras.
class FlatFolderCameras {
 public:
  FlatFolderCameras(KnownCameras known, Capture* capture) : known_(std::move(known)), capture_(*capture) {
    if (known_.of_all) capture_.cameras = known_.of_all->cameras;
  }

  // Appends the image, or a reject.
  Status Add(const std::string& name, int session, const cv::Mat& image) {
    const KnownCameras::List* list = known_.Of(session);
    if (list == nullptr) {
      AddGuessed(name, session, image);
      return Ok();
    }
    return AddKnown(*list, name, session, image.cols, image.rows);
  }

  // The same for an image without a file; `row` goes to the capture's features.
  Status Add(const std::string& name, int session, const FeaturesRow& row) {
    const KnownCameras::List* list = known_.Of(session);
    if (list == nullptr) {
      const CameraId camera_id =
          NewCamera(features_ids_, std::pair(row.path, row.camera.camera_id), [&] { return row.camera; });
      capture_.images.push_back({name, camera_id, std::nullopt});
    } else {
      CAIRN_RETURN_IF_ERROR(AddKnown(*list, name, session, row.camera.width, row.camera.height));
    }
    capture_.features.emplace(name, row);
    return Ok();
  }

  // Where focal lengths come from.
  void Finish() {
    for (const auto& [source, range] : focal_ranges_) {
      const std::string lengths = range.least_px == range.most_px
                                      ? fmt::format("f = {:.1f} px", range.least_px)
                                      : fmt::format("f = {:.1f} to {:.1f} px", range.least_px, range.most_px);
      capture_.notes.push_back(fmt::format("{}: {} of {} images from {}; the map refines them", capture_.root,
                                           lengths, range.num_images, FocalSourceText(source)));
    }
  }

 private:
  // The camera of the list that has this size.
  Status AddKnown(const KnownCameras::List& list, const std::string& name, int session, int width,
                  int height) {
    CAIRN_ASSIGN_OR_RETURN(const Camera* camera, CameraOfSize(list, name, width, height));
    if (camera == nullptr) {
      capture_.rejects.push_back({name, fmt::format("the image has {} x {} pixels, as no camera of {} has",
                                                    width, height, list.path)});
      return Ok();
    }
    CameraId camera_id = camera->camera_id;
    if (&list != (known_.of_all ? &*known_.of_all : nullptr))
      camera_id = NewCamera(known_ids_, std::pair(session, camera_id), [&] { return *camera; });
    capture_.images.push_back({name, camera_id, std::nullopt});
    return Ok();
  }

  // One camera for each session, image size and focal length in EXIF.
  void AddGuessed(const std::string& name, int session, const cv::Mat& image) {
    const ExifTags tags = ReadExif(capture_.images_folder + "/" + name);
    const std::optional<ExifFocal> focal = FocalOf(tags, std::max(image.cols, image.rows));
    const CameraId camera_id = NewCamera(
        guessed_ids_, std::tuple(session, image.cols, image.rows, focal ? focal->focal_px : 0), [&] {
          Camera camera = GuessCamera(0, image.cols, image.rows);
          if (focal) {
            camera.params[0] = focal->focal_px;
            camera.has_focal_prior = true;
          } else {
            capture_.warnings.push_back(
                fmt::format("{}: no cameras.txt and {}: f = 1.2 max(w, h) = {:g} px "
                            "assumed for {} x {} images",
                            capture_.root, WhyNoFocal(tags), camera.params[0], camera.width, camera.height));
          }
          return camera;
        });
    if (focal) {
      FocalRange& range = focal_ranges_[focal->source];
      range.least_px = range.num_images == 0 ? focal->focal_px : std::min(range.least_px, focal->focal_px);
      range.most_px = std::max(range.most_px, focal->focal_px);
      ++range.num_images;
    }
    capture_.images.push_back({name, camera_id, std::nullopt});
  }

  static std::string WhyNoFocal(const ExifTags& tags) {
    if (tags.focal_length_mm <= 0) return "no focal length in EXIF";
    return fmt::format("a focal length in EXIF of {:g} mm{}, but nothing that says how large the sensor is",
                       tags.focal_length_mm, tags.camera.empty() ? "" : " (" + tags.camera + ")");
  }

  // The id of the camera that `key` names; `make` returns the camera where it is new.
  template <typename Key, typename Make>
  CameraId NewCamera(std::map<Key, CameraId>& ids, const Key& key, const Make& make) {
    const auto [entry, is_new] =
        ids.emplace(key, capture_.cameras.empty() ? 1 : capture_.cameras.rbegin()->first + 1);
    if (is_new) {
      Camera camera = make();
      camera.camera_id = entry->second;
      capture_.cameras.emplace(entry->second, camera);
    }
    return entry->second;
  }

  struct FocalRange {
    double least_px = 0, most_px = 0;
    int64_t num_images = 0;
  };

  KnownCameras known_;
  Capture& capture_;
  std::map<FocalSource, FocalRange> focal_ranges_;
  std::map<std::pair<int, CameraId>, CameraId> known_ids_;
  std::map<std::pair<std::string, CameraId>, CameraId> features_ids_;
  std::map<std::tuple<int, int, int, double>, CameraId> guessed_ids_;
};

// Image files in the capture's folder itself, where it has one for images.
size_t NumImagesBeside(const Capture& capture) {
  if (capture.images_folder == capture.root) return 0;
  size_t num_beside = 0;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(capture.root, error))
    num_beside += HasImageSuffix(entry.path().string());
  return num_beside;
}

// Adds an image without a pose to those of the capture, or to its rejects.
Status AddUnposed(const std::string& name, int session, FlatFolderCameras* cameras, Capture* capture) {
  if (HasControlCharacter(name)) {
    capture->rejects.push_back({name, "its name has a control character, such as a line's end; rename it"});
    return Ok();
  }
  const Result<cv::Mat> image = ReadGreyImage(capture->images_folder + "/" + name);
  if (!image.ok()) {
    capture->rejects.push_back({name, image.error().message});
    return Ok();
  }
  return cameras->Add(name, session, *image);
}

// Where the features of images without a file are, and of those that a database replaces.
Status FindFeatures(const std::vector<CaptureImage>& images, CaptureFeatures* features, Capture* capture) {
  for (const CaptureImage& image : images) {
    std::error_code error;
    if (capture->features.contains(image.name)) continue;
    if (!features->ReplacesFiles(image.name) && fs::exists(capture->ImagePath(image), error)) continue;
    CAIRN_ASSIGN_OR_RETURN(const FeaturesRow* row, features->Find(image.name));
    if (row != nullptr) capture->features.emplace(image.name, *row);
  }
  return Ok();
}

// Moves images without file and features, or with a camera that cameras.txt lacks, to the rejects.
void RejectUnusable(CaptureFeatures* features, Capture* capture, std::vector<CaptureImage>* images) {
  std::erase_if(*images, [&](const CaptureImage& image) {
    std::string reason;
    std::error_code error;
    const std::string path = capture->ImagePath(image);
    const std::string database = features->PathFor(image.name);
    if (capture->FeaturesOf(image) != nullptr) {
      if (capture->cameras.count(image.camera_id) == 0)
        reason = fmt::format("camera {} is not in {}/cameras.txt", image.camera_id, capture->root);
    } else if (features->ReplacesFiles(image.name)) {
      reason =
          fmt::format("{}: no such image in it, and it has the features of this capture's images", database);
    } else if (!fs::exists(path, error) && !database.empty()) {
      reason = fmt::format("{}: no such file, and no such image in {}", path, database);
    } else if (!fs::exists(path, error)) {
      reason = fs::is_symlink(fs::symlink_status(path, error))
                   ? fmt::format("{}: a link to a file that does not exist", path)
                   : fmt::format("{}: no such file, but the image list names it", path);
    } else if (!fs::is_regular_file(path, error)) {
      reason = fmt::format("{}: not a file, but the image list names it", path);
    } else if (capture->cameras.count(image.camera_id) == 0) {
      reason = fmt::format("camera {} is not in {}/cameras.txt", image.camera_id, capture->root);
    }
    if (reason.empty()) return false;
    capture->rejects.push_back({image.name, reason});
    return true;
  });
}

// The images that a database of features has, where no file is of its session ("": of any): they are the
// session's.
Status AddUnposedFeatures(const std::vector<std::string>& names, const std::vector<std::string>& sessions,
                          const std::string& session, CaptureFeatures* features, FlatFolderCameras* cameras) {
  const bool has_files = std::any_of(names.begin(), names.end(), [&](const std::string& name) {
    return session.empty() || name.starts_with(session + "/");
  });
  if (has_files) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const auto* rows, features->List(session));
  for (const auto& [name, row] : *rows)
    CAIRN_RETURN_IF_ERROR(cameras->Add(name, SessionOfImage(sessions, name), row));
  return Ok();
}

void SortByName(std::vector<CaptureImage>* images) {
  std::sort(images->begin(), images->end(),
            [](const CaptureImage& a, const CaptureImage& b) { return a.name < b.name; });
}

// A capture without image lists.
Status ReadFlatFolder(Capture* capture) {
  const std::vector<std::string>& sessions = capture->sessions;
  const std::string queries = capture->root + "/queries.txt";
  if (IsThere(queries)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: held-out images are given with their poses, but without images.txt the capture has "
                     "none; add images.txt, or remove the list: [reconstruct] hold_out_every holds images "
                     "out of a capture without poses",
                     queries);
  }
  if (const std::string frame = capture->root + "/" + kCaptureFrameFile; IsThere(frame)) {
    capture->warnings.push_back(
        fmt::format("{}: not read: it says what poses mean, and without images.txt there are none", frame));
  }
  std::error_code error;
  capture->images_folder =
      fs::is_directory(capture->root + "/images", error) ? capture->root + "/images" : capture->root;
  if (const size_t num_beside = NumImagesBeside(*capture); num_beside > 0) {
    capture->warnings.push_back(
        fmt::format("{}: {} images beside the folder images/ are left out", capture->root, num_beside));
  }
  CAIRN_ASSIGN_OR_RETURN(KnownCameras known, ReadKnownCameras(capture->root, sessions, true));
  FlatFolderCameras cameras(std::move(known), capture);
  const std::vector<std::string> names = ListImages(capture->images_folder, sessions);
  for (const std::string& name : names)
    CAIRN_RETURN_IF_ERROR(AddUnposed(name, SessionOfImage(sessions, name), &cameras, capture));
  CaptureFeatures features(capture->root);
  CAIRN_RETURN_IF_ERROR(AddUnposedFeatures(names, sessions, "", &features, &cameras));
  for (const std::string& session : sessions)
    CAIRN_RETURN_IF_ERROR(AddUnposedFeatures(names, sessions, session, &features, &cameras));
  CAIRN_RETURN_IF_ERROR(FindFeatures(capture->images, &features, capture));
  SortByName(&capture->images);
  cameras.Finish();
  RejectUnusable(&features, capture, &capture->images);
  return Ok();
}

// Finds images of sessions to be registered that are copies of images which the capture has already: of its
// survey, they would count what is seen there twice; of its held-out images, the map would be tried on what
// it was made of.
class RegisteredCopies {
 public:
  explicit RegisteredCopies(const Capture& capture) {
    for (const CaptureImage& image : capture.images) copies_.FindOrAdd(capture.ImagePath(image));
    for (const CaptureImage& image : capture.queries) {
      copies_.FindOrAdd(capture.ImagePath(image));
      held_out_.insert(capture.ImagePath(image));
    }
  }

  // Whether it is a copy: then it is one of the rejects.
  bool Reject(const std::string& name, Capture* capture) {
    const std::string* original = copies_.FindOrAdd(capture->images_folder + "/" + name);
    if (original == nullptr) return false;
    const std::string of = fs::path(*original).lexically_relative(capture->images_folder).generic_string();
    capture->rejects.push_back(
        {name, held_out_.contains(*original)
                   ? fmt::format("the same file as {}, which is held out: the map would be tried on an image "
                                 "that it was made of",
                                 of)
                   : fmt::format("the same file as {}: it says nothing more", of)});
    return true;
  }

 private:
  ImageCopies copies_;
  std::set<std::string> held_out_;  // paths
};

// Images of sessions that have no pose in the frame of the others.
Status ReadRegistered(const std::vector<std::string>& names, CaptureFeatures* features, Capture* capture) {
  for (const auto* list : {&capture->images, &capture->queries}) {
    for (const CaptureImage& image : *list) {
      const int session = SessionOfImage(capture->registered, image.name);
      if (session < 0) continue;
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}/{} names {}, whose image {} has a pose beside it: take the session out of one of "
                       "the two lists",
                       capture->root, kRegisterFile, capture->registered[session], image.name);
    }
  }
  CAIRN_ASSIGN_OR_RETURN(KnownCameras known, ReadKnownCameras(capture->root, capture->registered, false));
  FlatFolderCameras cameras(std::move(known), capture);
  RegisteredCopies copies(*capture);
  for (const std::string& session : capture->registered) {
    const std::string path = SessionPosesPath(capture->root, session);
    if (!IsThere(path)) continue;
    CAIRN_ASSIGN_OR_RETURN(std::vector<CaptureImage> posed, ReadImagesText(path, &capture->rejects));
    for (CaptureImage& image : posed) {
      if (!image.name.starts_with(session + "/")) {
        return MakeError(ErrorCode::kCorrupt, "{}: '{}' is no image of the session", path, image.name);
      }
      if (copies.Reject(image.name, capture)) continue;
      capture->own_poses.emplace(image.name, *image.cam_from_world);
      image.cam_from_world.reset();
      capture->images.push_back(std::move(image));
    }
  }
  for (const std::string& name : names) {
    const int session = SessionOfImage(capture->registered, name);
    if (session < 0 || IsThere(SessionPosesPath(capture->root, capture->registered[session]))) continue;
    if (copies.Reject(name, capture)) continue;
    CAIRN_RETURN_IF_ERROR(AddUnposed(name, session, &cameras, capture));
  }
  for (const std::string& session : capture->registered) {
    if (IsThere(SessionPosesPath(capture->root, session))) continue;
    CAIRN_RETURN_IF_ERROR(AddUnposedFeatures(names, capture->registered, session, features, &cameras));
  }
  cameras.Finish();
  SortByName(&capture->images);
  return Ok();
}

// The lists of a capture with poses.
Status ReadLists(Capture* capture) {
  const std::string& root = capture->root;
  capture->images_folder = root + "/images";
  CAIRN_ASSIGN_OR_RETURN(capture->cameras, ReadCamerasText(root + "/cameras.txt"));
  CAIRN_ASSIGN_OR_RETURN(capture->images, ReadImagesText(root + "/images.txt", &capture->rejects));
  if (IsThere(root + "/queries.txt")) {
    CAIRN_ASSIGN_OR_RETURN(capture->queries, ReadImagesText(root + "/queries.txt", &capture->rejects));
  }
  if (const std::string frame = root + "/" + kCaptureFrameFile; IsThere(frame)) {
    CAIRN_ASSIGN_OR_RETURN(capture->frame, ReadCaptureFrame(frame));
  }
  const std::vector<std::string> names = ListImages(capture->images_folder, capture->sessions);
  CaptureFeatures features(root);
  if (const std::string path = root + "/" + kRegisterFile; IsThere(path)) {
    CAIRN_ASSIGN_OR_RETURN(capture->registered, ReadSessionsText(path));
    CAIRN_RETURN_IF_ERROR(ReadRegistered(names, &features, capture));
  }
  CAIRN_RETURN_IF_ERROR(FindFeatures(capture->images, &features, capture));
  CAIRN_RETURN_IF_ERROR(FindFeatures(capture->queries, &features, capture));
  capture->has_poses = capture->registered.empty();
  std::set<std::string> unlisted(names.begin(), names.end());
  for (const CaptureImage& image : capture->images) unlisted.erase(image.name);
  for (const CaptureImage& image : capture->queries) unlisted.erase(image.name);
  for (const Reject& reject : capture->rejects) unlisted.erase(reject.name);
  for (const std::string& name : unlisted) {
    capture->warnings.push_back(
        fmt::format("{}/{}: in neither images.txt nor queries.txt; left out", capture->images_folder, name));
  }
  RejectUnusable(&features, capture, &capture->images);
  RejectUnusable(&features, capture, &capture->queries);
  return Ok();
}

// What looks like odometry, under a name that is not read.
void WarnOfUnreadOdometry(Capture* capture) {
  if (IsThere(capture->root + "/" + kOdometryFile)) return;
  for (const char* name : {"odometry.csv", "odometry.tum", "odom.csv", "odom.txt"}) {
    const std::string path = capture->root + "/" + name;
    if (!IsThere(path)) continue;
    capture->warnings.push_back(
        fmt::format("{}: not read; if it says where the camera was, call it {}: IMAGE, or a time, "
                    "TX TY TZ QX QY QZ QW a line, metres",
                    path, kOdometryFile));
  }
}

// Databases of features whose end is missing.
void WarnOfCutFeatures(Capture* capture) {
  std::set<std::string> paths;
  for (const auto& [name, row] : capture->features) paths.insert(row.path);
  for (const std::string& path : paths) {
    const DatabasePart part = PartOfDatabase(path);
    if (!part.is_cut()) continue;
    capture->warnings.push_back(
        CutText(path, part) +
        "; images whose features are among them are taken, for the others copy it again");
  }
}

}  // namespace

std::string SessionCamerasPath(const std::string& root, const std::string& session) {
  return fmt::format("{}/cameras/{}.txt", root, session);
}

std::string SessionImuPath(const std::string& root, const std::string& session) {
  return fmt::format("{}/imu/{}.csv", root, session);
}

std::string SessionPosesPath(const std::string& root, const std::string& session) {
  return fmt::format("{}/poses/{}.txt", root, session);
}

Result<std::vector<CaptureImage>> ReadImagesText(const std::string& path, std::vector<Reject>* rejects) {
  std::vector<CaptureImage> images;
  CAIRN_RETURN_IF_ERROR(VisitImageList(path, [&](ListedImage listed) {
    ModelImage& image = listed.image;
    if (const Status status = NormalizePose(&image.cam_from_world); !status.ok()) {
      rejects->push_back(
          {image.name, fmt::format("{}:{}: {}", path, listed.line_number, status.error().message)});
    } else if (HasControlCharacter(image.name)) {
      rejects->push_back(
          {image.name, fmt::format("{}:{}: the image's name has a control character; rename it", path,
                                   listed.line_number)});
    } else if (!IsPathBelow(image.name)) {
      rejects->push_back(
          {image.name, fmt::format("{}:{}: the image's name leads out of the folder of images; move it there",
                                   path, listed.line_number)});
    } else {
      images.push_back({std::move(image.name), image.camera_id, image.cam_from_world});
    }
  }));
  const auto by_name = [](const auto& a, const auto& b) { return a.name < b.name; };
  std::stable_sort(images.begin(), images.end(), by_name);
  const auto twice = std::adjacent_find(images.begin(), images.end(),
                                        [](const auto& a, const auto& b) { return a.name == b.name; });
  if (twice != images.end()) {
    return MakeError(ErrorCode::kCorrupt, "{}: lists '{}' twice; which pose is right? remove one", path,
                     twice->name);
  }
  return images;
}

Status WriteImagesText(const std::string& path, const std::vector<CaptureImage>& images) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME (cam_from_world, metres); second line empty\n";
  for (size_t i = 0; i < images.size(); ++i) {
    CAIRN_RETURN_IF_ERROR(CheckListedName(path, images[i].name));
    const Pose& pose = *images[i].cam_from_world;
    text +=
        fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.6f} {:.6f} {:.6f} {} {}\n\n", i + 1, pose.rotation.w(),
                    pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.translation.x(),
                    pose.translation.y(), pose.translation.z(), images[i].camera_id, images[i].name);
  }
  return WriteFileAtomically(path, text);
}

Result<Capture> ReadCapture(const std::string& root) {
  std::error_code error;
  if (!fs::is_directory(root, error)) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: no such folder; a capture is a folder with images/, cameras.txt and "
                     "images.txt, or a flat folder of images",
                     root);
  }
  Capture capture;
  capture.root = root;
  if (const std::string path = root + "/" + kSessionsFile; IsThere(path)) {
    CAIRN_ASSIGN_OR_RETURN(capture.sessions, ReadSessionsText(path));
  }
  if (!IsThere(root + "/images.txt")) {
    CAIRN_RETURN_IF_ERROR(ReadFlatFolder(&capture));
  } else {
    if (!IsThere(root + "/cameras.txt")) {
      return MakeError(ErrorCode::kNotFound,
                       "{}/cameras.txt: no such file, but images.txt names its cameras; write it, or remove "
                       "images.txt: the capture then has no poses, and its cameras come from EXIF",
                       root);
    }
    CAIRN_RETURN_IF_ERROR(ReadLists(&capture));
  }
  if (capture.images.empty()) {
    const std::string first = capture.rejects.empty()
                                  ? IsThere(root + "/images.txt") ? "; images.txt lists none" : ""
                                  : "; the first of " + std::to_string(capture.rejects.size()) +
                                        " rejected: " + capture.rejects[0].reason;
    return MakeError(ErrorCode::kNoData, "{}: no usable image{}", root, first);
  }
  if (!capture.has_poses) WarnOfUnreadOdometry(&capture);
  WarnOfCutFeatures(&capture);
  return capture;
}

}  // namespace cairn
