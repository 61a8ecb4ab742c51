#include <filesystem>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include "core/line/program_identity.h"
#include "core/line/reuse.h"
#include "core/line/reuse_arguments.h"

namespace cairn {
namespace {

TEST(Shard, IsReadFromText) {
  const auto shard = ParseShard("3/64");
  ASSERT_TRUE(shard.ok());
  EXPECT_EQ(shard->index, 3);
  EXPECT_EQ(shard->count, 64);
  for (const char* bad :
       {"", "x", "3", "/", "0/3", "4/3", "-1/3", "1/0", "1/3/5", "1 /3", "1/3 ", "1/99999999999"})
    EXPECT_EQ(ParseShard(bad).error().code, ErrorCode::kInvalidArgument) << bad;
}

TEST(Shard, SharesAreEverythingOnce) {
  for (const int64_t num_items : {0, 1, 2, 7, 64, 1000}) {
    for (const int count : {1, 2, 3, 7, 100}) {
      int64_t end = 0;
      for (int index = 1; index <= count; ++index) {
        const auto [first, second] = ShareOf({index, count}, num_items);
        EXPECT_EQ(first, end);
        EXPECT_GE(second - first, num_items / count);
        EXPECT_LE(second - first, num_items / count + 1);
        end = second;
      }
      EXPECT_EQ(end, num_items);
    }
  }
}

TEST(ProgramIdentity, IsAHashAndStays) {
  EXPECT_EQ(ProgramIdentity().size(), 32u);
  EXPECT_EQ(ProgramIdentity(), ProgramIdentity());
}

class ReuseTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/reuse_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  // A database of one number, and where it has it.
  std::string Write(const std::string& name, int number, const std::vector<ReuseEntry>& entries) {
    const std::string path = folder_ + "/" + name;
    EXPECT_TRUE(WriteDatabase(path, "CREATE TABLE numbers (number INTEGER)", [&](SQLite::Database& database) {
                  database.exec(fmt::format("INSERT INTO numbers VALUES ({})", number));
                  return Ok();
                }).ok());
    EXPECT_TRUE(WriteReuseFile(path, entries).ok());
    return path;
  }
  static std::optional<int> Number(const ReuseEntry&, ReuseSources::Source& source) {
    return source.Database().execAndGet("SELECT number FROM numbers").getInt();
  }
  std::string folder_;
};

TEST_F(ReuseTest, EntriesComeBackInTheOrderOfTheirKeys) {
  const ReuseEntry large{{2, 0}, {5, 6}, -7, int64_t{1} << 40}, small{{1, 9}, {0, 0}, 1, 0};
  const auto entries = ReadReuseFile(Write("a.db", 1, {large, small}));
  ASSERT_TRUE(entries.ok()) << entries.error().message;
  ASSERT_EQ(entries->size(), 2u);
  EXPECT_EQ(entries->at(0).key, small.key);
  EXPECT_EQ(entries->at(1).contents, large.contents);
  EXPECT_EQ(entries->at(1).row, -7);
  EXPECT_EQ(entries->at(1).count, int64_t{1} << 40);
}

TEST_F(ReuseTest, TheFirstSourceWithAUsableResultGivesIt) {
  ReuseSources sources;
  EXPECT_FALSE(sources.Find({1, 1}, Number));
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(sources.Add(Write(std::to_string(i) + ".db", i, {{.key = {1, 1}, .row = i}})).ok());
  EXPECT_EQ(sources.Find({1, 1}, Number), 0);
  EXPECT_FALSE(sources.Find({1, 2}, Number));
  const auto number_of_last = [](const ReuseEntry& entry, ReuseSources::Source& source) {
    return entry.row < 2 ? std::nullopt : Number(entry, source);
  };
  EXPECT_EQ(sources.Find({1, 1}, number_of_last), 2);
  std::filesystem::remove(folder_ + "/0.db");
  ReuseSources others;
  others.AddIfReadable(folder_ + "/0.db");
  EXPECT_EQ(others.unusable().size(), 1u);
  EXPECT_FALSE(others.Find({1, 1}, Number));
}

TEST_F(ReuseTest, MoreSourcesThanMayBeOpen) {
  ReuseSources sources;
  for (uint64_t i = 0; i < 100; ++i)
    ASSERT_TRUE(sources.Add(Write(std::to_string(i) + ".db", static_cast<int>(i), {{.key = {i, 0}}})).ok());
  for (int round = 0; round < 2; ++round)
    for (uint64_t i = 0; i < 100; ++i) EXPECT_EQ(sources.Find({i, 0}, Number), static_cast<int>(i));
}

TEST_F(ReuseTest, AShardDoesNotReplaceWhatItReads) {
  const std::string path = Write("a.db", 1, {});
  const auto apply = [&](std::vector<std::string> argv) {
    CLI::App app;
    ReuseArguments arguments;
    ArgumentParser parser(app);
    arguments.Add(parser, "images");
    std::reverse(argv.begin(), argv.end());
    app.parse(argv);
    return arguments.Apply(path);
  };
  EXPECT_TRUE(apply({"--reuse", path})->previous);
  EXPECT_FALSE(apply({"--no-reuse"})->previous);
  EXPECT_EQ(apply({"--reuse", "x", "--reuse", "y", "--shard", "2/2"})->files.size(), 2u);
  EXPECT_THROW(apply({"--reuse", "x", "--no-reuse"}), CLI::ParseError);
  const auto same = apply({"--reuse", folder_ + "/./a.db", "--shard", "1/2"});
  ASSERT_FALSE(same.ok());
  EXPECT_EQ(same.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(apply({"--shard", "0/2"}).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn
