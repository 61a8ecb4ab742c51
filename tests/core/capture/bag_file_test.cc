#include "core/capture/bag_file.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/database.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

class BagFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("bag_file_test_{}", getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  std::string Write(const std::string& name, const std::string& bytes) const {
    fs::create_directories(fs::path(Path(name)).parent_path());
    EXPECT_TRUE(WriteFileAtomically(Path(name), bytes).ok());
    return Path(name);
  }
  std::string WriteTables(const std::string& name, const std::string& schema) const {
    SQLite::Database(Path(name), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(schema);
    return Path(name);
  }
  fs::path folder_;
};

TEST_F(BagFileTest, ABagIsKnownByItsFirstBytes) {
  EXPECT_TRUE(IsBag(Write("ros1", "#ROSBAG V2.0\n")));
  EXPECT_TRUE(IsBag(Write("mcap", "\x89MCAP0\r\n")));
  EXPECT_FALSE(IsBag(Write("text", "MCAP #ROSBAG")));
  EXPECT_FALSE(IsBag(Write("short", "#ROS")));
  EXPECT_FALSE(IsBag(Write("empty", "")));
}

// Maps and what stages write are SQLite's too.
TEST_F(BagFileTest, ASqliteFileIsABagByItsTables) {
  EXPECT_TRUE(IsBag(WriteTables("run", "CREATE TABLE topics (id); CREATE TABLE messages (id)")));
  EXPECT_FALSE(IsBag(WriteTables("a.cairn", "CREATE TABLE meta (key)")));
  EXPECT_FALSE(IsBag(WriteTables("topics.db", "CREATE TABLE topics (id)")));
  EXPECT_FALSE(IsBag(WriteTables("messages.db", "CREATE TABLE messages (id)")));
  EXPECT_FALSE(IsBag(Write("damaged.db", "SQLite format 3\0 and no page")));
  EXPECT_EQ(BagStorageOf(Path("a.cairn")), BagStorage::kSqlite);
}

// Then what is wrong with it is told of a bag.
TEST_F(BagFileTest, ABagIsKnownByItsName) {
  for (const char* name : {"a.bag", "a.mcap", "a.db3"}) {
    EXPECT_TRUE(IsBag(Write(name, "text"))) << name;
    EXPECT_EQ(BagStorageOf(Path(name)), BagStorage::kNone);
  }
  EXPECT_FALSE(IsBag(Write("bag", "text")));
  EXPECT_FALSE(IsBag(Write("a.bag.txt", "text")));
  EXPECT_FALSE(IsBag(Path("none.bag")));
}

TEST_F(BagFileTest, AFolderIsABagByTheFilesInIt) {
  fs::create_directories(Path("run/inner"));
  EXPECT_FALSE(IsBag(Path("run")));
  EXPECT_THAT(FilesOfBag(Path("run")), IsEmpty());
  Write("run/metadata.yaml", "name: a data set\n");
  EXPECT_FALSE(IsBag(Path("run")));
  Write("run/metadata.yaml", "rosbag2_bagfile_information:\n");
  EXPECT_TRUE(IsBag(Path("run")));  // its files are missing, which the reader says
  Write("run/run_10.db3", "");
  Write("run/run_9.db3", "");
  Write("run/notes of the day.txt", "");
  Write("run/inner/other.db3", "");
  EXPECT_THAT(BagsInFolder(Path("run")), ElementsAre(Path("run/run_9.db3"), Path("run/run_10.db3")));
  EXPECT_THAT(FilesOfBag(Path("run")),
              ElementsAre(Path("run/metadata.yaml"), Path("run/run_9.db3"), Path("run/run_10.db3")));
  fs::remove(Path("run/metadata.yaml"));
  EXPECT_TRUE(IsBag(Path("run")));
  EXPECT_THAT(FilesOfBag(Path("run/run_9.db3")), ElementsAre(Path("run/run_9.db3")));
}

}  // namespace
}  // namespace cairn
