#include "core/files/disk_space.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(CheckDiskSpace, SaysHowMuchIsNeededAndHowMuchIsLeft) {
  const std::string folder = testing::TempDir();
  const auto available = [&] { return static_cast<double>(std::filesystem::space(folder).available); };
  const double before = available();
  const Status status = CheckDiskSpace("a copy", folder, 2'000'000'000'000'000'000);
  const double after = available();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kDiskFull);
  const std::string& message = status.error().message;
  EXPECT_THAT(message, StartsWith(folder + ": a copy takes about 2000000000000 MB, but the disk has "));
  const std::string before_number = "the disk has ";
  const double left_mb =
      std::strtod(message.c_str() + message.find(before_number) + before_number.size(), nullptr);
  // Others write to the disk meanwhile: up to a tenth of it.
  EXPECT_GE(left_mb, 0.9e-6 * std::min(before, after) - 1);
  EXPECT_LE(left_mb, 1.1e-6 * std::max(before, after) + 1);
}

TEST(CheckDiskSpace, FolderOfARelativeNameIsTheCurrentOne) {
  EXPECT_TRUE(CheckDiskSpace("little", "", 1).ok());
  EXPECT_FALSE(CheckDiskSpace("much", "", 2'000'000'000'000'000'000).ok());
}

// Writing will tell.
TEST(CheckDiskSpace, WhereItIsNotKnownNothingIsRefused) {
  EXPECT_TRUE(CheckDiskSpace("much", "/nowhere/at all", 2'000'000'000'000'000'000).ok());
}

}  // namespace
}  // namespace cairn
