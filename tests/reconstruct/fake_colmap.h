#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::reconstruct {

// A program named colmap first on PATH, for as long as the object lives.
class FakeColmap {
 public:
  explicit FakeColmap(const std::string& script) : path_(std::getenv("PATH")) {
    const std::string folder = testing::TempDir() + "/fake_colmap";
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    EXPECT_TRUE(WriteFileAtomically(folder + "/colmap", "#!/bin/sh\n" + script + "\n").ok());
    std::filesystem::permissions(folder + "/colmap", std::filesystem::perms::owner_all);
    setenv("PATH", (folder + ":" + path_).c_str(), 1);
  }
  ~FakeColmap() { setenv("PATH", path_.c_str(), 1); }

 private:
  std::string path_;
};

}  // namespace cairn::reconstruct
