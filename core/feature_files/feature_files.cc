#include "core/feature_files/feature_files.h"

#include <filesystem>

namespace cairn {

namespace fs = std::filesystem;

Result<FeatureFiles> FeatureFiles::Open(const std::string& path, const std::string& descriptors) {
  CAIRN_ASSIGN_OR_RETURN(const DescriptorChoice choice, ParseDescriptorChoice(descriptors));
  std::error_code error;
  if (!fs::exists(path, error)) {
    return MakeError(
        ErrorCode::kNotFound,
        "{}: no such file or folder; expected a COLMAP database, a kapture folder or a folder of .npz "
        "files",
        path);
  }
  const std::string of_capture = path + "/features.db";
  if (fs::exists(of_capture, error)) return Open(of_capture, descriptors);
  FeatureFiles files;
  Result<std::unique_ptr<FeatureReader>> reader = [&] {
    if (!fs::is_directory(path, error)) {
      files.layout_ = "COLMAP database";
      return OpenColmapFeatures(path);
    }
    if (IsKaptureWithFeatures(path)) {
      files.layout_ = "kapture folder";
      return OpenKaptureFeatures(path);
    }
    files.layout_ = "folder of .npz files";
    return OpenNpzFeatures(path);
  }();
  if (!reader.ok()) return reader.error();
  files.reader_ = std::move(*reader);
  Result<DescriptorKind> kind = files.reader_->Kind(choice);
  if (!kind.ok()) return MakeError(kind.error().code, "{}: {}", path, kind.error().message);
  files.kind_ = std::move(*kind);
  return files;
}

Result<std::optional<Features>> FeatureFiles::Find(const std::string& name) const {
  return reader_->Read(name, kind_);
}

}  // namespace cairn
