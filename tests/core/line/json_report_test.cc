#include "core/line/json_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"

namespace cairn {
namespace {

using testing::HasSubstr;

class JsonReportTest : public testing::Test {
 protected:
  Result<nlohmann::ordered_json> Read(const std::string& text) {
    const std::string path = testing::TempDir() + "/json_report_test.json";
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
    return ReadJsonReport(path, "what a run wrote");
  }
};

std::string Nested(int depth) {
  return R"({"deep": )" + std::string(depth, '[') + std::string(depth, ']') + R"(, "next": 1})";
}

TEST_F(JsonReportTest, KeepsTheOrderOfItsKeys) {
  EXPECT_EQ(Read(R"({"b":1,"a":[2]})")->dump(), R"({"b":1,"a":[2]})");
}

TEST_F(JsonReportTest, WhatIsNestedTooDeeplyIsLeftOutAndTheRestRead) {
  EXPECT_EQ(Read(Nested(50))->dump(), nlohmann::ordered_json::parse(Nested(50)).dump());
  const auto deep = Read(Nested(1000000));
  ASSERT_TRUE(deep.ok());
  EXPECT_EQ((*deep)["next"], 1);
  EXPECT_LE(deep->dump().size(), 250u);
}

TEST_F(JsonReportTest, OtherFilesAreRefusedWithWhatWasExpected) {
  for (const char* text : {"", "[1]", "{", "3", "{\"a\":}", "\xff"}) {
    const auto read = Read(text);
    ASSERT_FALSE(read.ok()) << text;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << text;
    EXPECT_THAT(read.error().message, HasSubstr("what a run wrote"));
  }
  EXPECT_EQ(ReadJsonReport("/none.json", "a report").error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace cairn
