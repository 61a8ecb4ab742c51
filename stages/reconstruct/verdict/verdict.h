#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "stages/reconstruct/verdict/find_loops.h"

namespace cairn::reconstruct {

// What a person asks of a reconstruction: is it whole, how long are its loops, where is it weak?  And what a
// picture of it from above needs.  Names follow each other in their natural order ("2.jpg" before "10.jpg"),
// those of a folder together: a folder is a walk of its own.

struct JudgeOptions {
  // A drive: of this part of its images the next one sees at least this part of the points that the one of
  // the two that is less joined has in common with any image.  REQUIRES: in [0, 1]
  double min_drive_ratio = 0.8;
  double min_next_ratio = 0.4;
  // What joins an image of a drive to the next: points that one of this many images up to it and one of as
  // many after it see.  A blurred image between does not part them.  REQUIRES: >= 1
  int num_images_of_side = 3;
  // With fewer, a link is weak; and so is an image that sees fewer points.  REQUIRES: >= 0
  int min_link_points = 50;
  int min_image_points = 50;
  // A step that is more than so many times the median one, for each image from one to the other, is long.
  // REQUIRES: >= 1
  double max_step_ratio = 5;
  FindLoopsOptions loops;
};

struct JoinedImage {
  std::string name;
  // From above, in the map's unit: x and y of the world, which is level; where the images stand in an upright
  // plane or where `up` is not known, in that plane.
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  int num_points = 0;  // that it sees, by which it has its pose
};

// Of a drive, an image and the next one that is joined; else the links of a tree that joins all images with
// most points in common.
struct ImageLink {
  int image1 = 0;  // index into Verdict::images
  int image2 = 0;
  int num_points = 0;   // that join them
  int num_missing = 0;  // images between them, by name, that are not joined
  double length = 0;    // in the map's unit
};

struct MissingImage {
  std::string name;
  std::string reason;
  // The joined images of its folder between which its name stands, as indices; -1: none.
  int before = -1;
  int after = -1;
};

// Images that are joined with each other, but not with the rest.
struct SeparatePart {
  int num_images = 0;
  std::string first, last;  // by name
};

// The images of a folder: of a session, where captures were joined.
struct Walk {
  std::string folder;  // "": of none
  int num_images = 0;
  int num_joined = 0;
  int num_points_of_others = 0;  // of its points those that other folders' images see too
};

struct Verdict {
  bool is_metric = false;  // lengths are metres; else in a unit that nobody knows
  bool is_drive = false;   // images follow each other by name
  std::vector<JoinedImage> images;
  std::vector<ImageLink> links;
  std::vector<MissingImage> missing;
  std::vector<SeparatePart> parts;  // besides the one that is kept, the largest first
  std::vector<Walk> walks;
  // Of a drive:
  double way = 0;                           // length of its steps
  double median_step = 0;                   // of those on which the camera moves
  std::vector<LoopPair> loops, loop_pairs;  // find_loops.h
  std::vector<OpenStretch> open_stretches;  // the longest first
  // Where it is weak, the weakest first; indices of links, and of images.
  std::vector<int> weak_links, long_steps, weak_images;

  int num_images() const { return static_cast<int>(images.size() + missing.size()); }
  bool is_whole() const { return missing.empty(); }
};

struct JudgedModels {
  const std::vector<ColmapModel>* models = nullptr;  // the one that is kept first
  std::vector<Pose> cam_from_world;                  // of its images, in the map's frame
  std::vector<Reject> rejects;                       // images that are not in it, and why
  bool is_metric = false;
};

// Lengths are rounded to a hundred thousandth of the unit, so that they are the same when they are read back.
// REQUIRES: the kept model has an image.  Same result for the same models, in any order of images or points.
Verdict Judge(const JudgedModels& judged, const JudgeOptions& options);

}  // namespace cairn::reconstruct
