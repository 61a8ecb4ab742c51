#include "core/feature_files/feature_files.h"

#include <filesystem>

#include "core/files/file.h"

namespace cairn {

namespace fs = std::filesystem;

bool IsPathBelow(const std::string& name) {
  const fs::path path(name);
  return !name.empty() && path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
}

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
  FeatureFiles files;
  const std::string of_capture = path + "/features.db";
  if (fs::exists(of_capture, error)) return Open(of_capture, descriptors);
  Result<std::unique_ptr<FeatureReader>> reader = [&] {
    if (!fs::is_directory(path, error)) {
      files.layout_ = "COLMAP database";
      return OpenColmapFeatures(path);
    }
    files.layout_ = IsKaptureWithFeatures(path) ? "kapture folder" : "folder of .npz files";
    return IsKaptureWithFeatures(path) ? OpenKaptureFeatures(path) : OpenNpzFeatures(path);
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
