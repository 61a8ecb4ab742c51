#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/feature_files/raw_features.h"
#include "core/features/features.h"

namespace cairn {

// Of one layout.
class FeatureReader {
 public:
  virtual ~FeatureReader() = default;
  // What kind its descriptors are, as far as its files say.
  virtual Result<DescriptorKind> Kind(const DescriptorChoice& choice) const = 0;
  // Of the image of this name, with descriptors of this kind; nothing where there are none.  May be called by
  // several threads.
  virtual Result<std::optional<Features>> Read(const std::string& name, const DescriptorKind& kind) const = 0;
};

// Features that another program found, by the names of images, in one of
// - a COLMAP database (also one of pycolmap), whose descriptors may be of any kind, or a folder with one as
//   features.db (a capture);
// - a kapture folder, version 1.0 or 1.1 (reconstruction/keypoints and descriptors), in COLMAP's pixels
//   [kapture_format, "keypoints/*.kpt": (0, 0) is the upper left corner];
// - a folder of .npz files, IMAGE.npz or IMAGE with its ending replaced, each with the arrays `keypoints`
//   (n x 2, 3, 4 or 6: x, y, scale, orientation; x, y, an affine shape) and `descriptors` (n x d, or d x n as
//   hloc has them), in NumPy's and OpenCV's pixels, whose first is centred at (0, 0).
class FeatureFiles {
 public:
  // `descriptors` as ParseDescriptorChoice.  Errors: NotFound (no such file or folder), NoData (nothing of
  // these in it), InvalidArgument, Corrupt, Unsupported; each names the file.
  static Result<FeatureFiles> Open(const std::string& path, const std::string& descriptors = "auto");

  const DescriptorKind& kind() const { return kind_; }
  // "COLMAP database", "kapture folder", "folder of .npz files".
  const std::string& layout() const { return layout_; }
  // Nothing where it has none of the image.  Errors: Corrupt, Unsupported, Io; each names the file.
  Result<std::optional<Features>> Find(const std::string& name) const;

 private:
  std::string layout_;
  std::shared_ptr<const FeatureReader> reader_;
  DescriptorKind kind_;
};

Result<std::unique_ptr<FeatureReader>> OpenColmapFeatures(const std::string& path);
Result<std::unique_ptr<FeatureReader>> OpenKaptureFeatures(const std::string& path);
Result<std::unique_ptr<FeatureReader>> OpenNpzFeatures(const std::string& path);
// What makes a folder one of kapture's.
bool IsKaptureWithFeatures(const std::string& path);

}  // namespace cairn
