#include "core/options/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/options/toml_options.h"

namespace cairn {
namespace {

struct Fields {
  bool flag = true;
  int count = 16;
  double ratio = 0.8;
  std::string pairs = "auto";
  std::vector<double> up = {0, 0, 1};
};

OptionTable Describe(Fields* f) {
  return {{.name = "flag", .value = &f->flag, .help = "a flag"},
          {.name = "min_count", .value = &f->count, .help = "a count", .min = 1, .max = 100},
          {.name = "max_ratio", .value = &f->ratio, .help = "a ratio", .min = 0, .max = 1},
          {.name = "pairs", .value = &f->pairs, .help = "which", .choices = {"auto", "frustum"}},
          {.name = "up", .value = &f->up, .help = "direction"}};
}

std::string WriteToml(const std::string& text) {
  // One file per test: they run in parallel.
  const std::string path = testing::TempDir() + "/options_" +
                           testing::UnitTest::GetInstance()->current_test_info()->name() + ".toml";
  EXPECT_TRUE(WriteFileAtomically(path, text).ok());
  return path;
}

// The parser takes their parts one inside the other.
TEST(ParseToml, KeysOfVeryManyPartsAreRefused) {
  const auto parts = [](int num, const std::string& between) {
    std::string key = "a";
    for (int i = 1; i < num; ++i) key += between + "a";
    return key;
  };
  EXPECT_TRUE(ParseToml(parts(100, ".") + " = 1\n", "x.toml").ok());
  for (const std::string& text :
       {parts(101, ".") + " = 1\n", parts(100'000, ".") + " = 1\n", parts(100'000, " . ") + " = 1\n",
        "[" + parts(100'000, ".") + "]\n", "[[" + parts(100'000, ".") + "]]\n",
        "x = {" + parts(100'000, ".") + " = 1}\n", "x = [1, {y = 2, " + parts(100'000, ".") + " = 1}]\n",
        parts(100'000, ".\"b.c\".'d'.") + " = 1\n",
        "x = \"a\\\"b\" # '\n" + parts(100'000, ".") + " = 1\n"}) {
    const Result<toml::table> table = ParseToml(text, "x.toml");
    ASSERT_FALSE(table.ok()) << text.substr(0, 60);
    EXPECT_EQ(table.error().code, ErrorCode::kCorrupt);
    EXPECT_EQ(table.error().message, "x.toml: not TOML for cairn: a key of more than 100 parts");
  }
  // A string of several lines that ends with five quotes looks like the beginning of another one.
  const Result<toml::table> hidden =
      ParseToml("x = [\"\"\"\n\"\"\"\"\", {" + parts(100'000, ".") + " = 1}]\n", "x.toml");
  ASSERT_FALSE(hidden.ok());
  EXPECT_EQ(hidden.error().message, "x.toml: not TOML for cairn: more than 10000 dots");
  EXPECT_TRUE(ParseToml("x = '''\n" + std::string(99, '.') + "\n'''\n", "x.toml").ok());
  // Not keys: numbers, texts and remarks.
  std::string numbers = "x = [0.5";
  for (int i = 0; i < 300; ++i) numbers += ", 1.5";
  EXPECT_TRUE(ParseToml(numbers + "]\n", "x.toml").ok());
  EXPECT_TRUE(
      ParseToml("x = \"" + parts(300, ".") + "\" # " + parts(300, ".") + "\ny = '" + parts(300, ".") + "'\n",
                "x.toml")
          .ok());
}

TEST(Options, TomlRoundTripKeepsEveryValue) {
  Fields written{.flag = false, .count = 7, .ratio = 0.1, .pairs = "frustum", .up = {1, 0, 0.5}};
  Fields read;
  ASSERT_TRUE(ReadOptionsFile(WriteToml(OptionsToml(Describe(&written))), Describe(&read)).ok());
  EXPECT_EQ(OptionsToml(Describe(&read)), OptionsToml(Describe(&written)));
  EXPECT_EQ(read.ratio, 0.1);
  EXPECT_THAT(read.up, testing::ElementsAre(1, 0, 0.5));
}

TEST(Options, AWordStandsForANumberOutsideOfTheRange) {
  double ratio = -1;
  const OptionTable table = {
      {.name = "ratio", .value = &ratio, .help = "a ratio", .min = 0, .max = 0.5, .words = {{"auto", -1}}}};
  EXPECT_EQ(OptionsToml(table), "ratio = 'auto'\n");
  EXPECT_TRUE(CheckOptions(table).ok());
  EXPECT_EQ(ValuesText(table[0]), "auto, or 0 to 0.5");
  ASSERT_TRUE(ReadOptionsFile(WriteToml("ratio = 0.25\n"), table).ok());
  EXPECT_EQ(ratio, 0.25);
  EXPECT_EQ(OptionsToml(table), "ratio = 0.25\n");
  ASSERT_TRUE(ReadOptionsFile(WriteToml("ratio = \"auto\"\n"), table).ok());
  EXPECT_EQ(ratio, -1);
  EXPECT_THAT(SetOption(table[0], "0.6").error().message,
              testing::HasSubstr("option ratio = 0.6: must be auto, or in [0, 0.5]"));
  EXPECT_THAT(SetOption(table[0], "most").error().message,
              testing::HasSubstr("option ratio: expected auto, or a number, found 'most'"));
}

TEST(Options, ARangeIsOfEachNumberOfAList) {
  std::vector<double> ratios = {0, 0.5, 1};
  const OptionTable table = {{.name = "ratios", .value = &ratios, .help = "ratios", .min = 0, .max = 1}};
  EXPECT_TRUE(CheckOptions(table).ok());
  for (const double outside : {-0.1, 1.1}) {
    ratios[1] = outside;
    EXPECT_THAT(CheckOptions(table).error().message, testing::HasSubstr("must be in [0, 1]"));
  }
  ratios.clear();
  EXPECT_TRUE(CheckOptions(table).ok());
}

TEST(Options, UnknownKeyNamesTheNearestOne) {
  Fields fields;
  const Status status = ReadOptionsFile(WriteToml("flag = true\nmin_cuont = 3\n"), Describe(&fields));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message,
              testing::HasSubstr(":2: unknown option 'min_cuont'; did you mean 'min_count'?"));
}

TEST(Options, ValueOutsideItsRangeIsAnError) {
  Fields fields;
  EXPECT_THAT(SetOption(Describe(&fields)[1], "0").error().message,
              testing::HasSubstr("must be in [1, 100]"));
  for (const char* text : {"nan", "inf", "-inf", "1e999"})
    EXPECT_FALSE(SetOption(Describe(&fields)[2], text).ok()) << text;
  // Also where the range has no end.
  double open = 1;
  for (const char* text : {"inf", "-inf", "nan"}) {
    EXPECT_THAT(SetOption({.name = "open", .value = &open, .min = 0}, text).error().message,
                testing::HasSubstr("must be a finite number, at least 0"));
    EXPECT_THAT(SetOption({.name = "open", .value = &open}, text).error().message,
                testing::HasSubstr("must be a finite number"));
  }
  EXPECT_THAT(SetOption(Describe(&fields)[3], "all").error().message, testing::HasSubstr("auto, frustum"));
}

TEST(Options, WrongTypeSaysWhatWasExpected) {
  Fields fields;
  const Status status = ReadOptionsFile(WriteToml("min_count = \"many\"\n"), Describe(&fields));
  EXPECT_THAT(status.error().message, testing::HasSubstr("expected an integer, found 'many'"));
}

TEST(Options, BrokenTomlNamesTheLine) {
  Fields fields;
  const Status status = ReadOptionsFile(WriteToml("flag = true\nup = [1,\n"), Describe(&fields));
  EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
}

TEST(Options, ConditionsSayWhereAnOptionIsRead) {
  Fields fields;
  OptionTable table = Describe(&fields);
  AddCondition({"pairs", {"frustum"}}, {"max_ratio", "min_count"}, &table);
  AddCondition({"min_count", {"not 0"}}, {"max_ratio"}, &table);
  const auto is_read = [&](size_t i) { return CheckIsRead(table[i], table); };
  EXPECT_EQ(NamesOf(table), (std::vector<std::string>{"flag", "min_count", "max_ratio", "pairs", "up"}));
  EXPECT_TRUE(is_read(0).ok());
  EXPECT_EQ(
      is_read(1).error().message,
      "min_count is only read where pairs is frustum, and it is auto; leave min_count out, or change pairs");
  EXPECT_FALSE(is_read(2).ok());
  fields.pairs = "frustum";
  EXPECT_TRUE(is_read(1).ok());
  EXPECT_TRUE(is_read(2).ok());
  fields.count = 0;  // both conditions have to hold
  EXPECT_EQ(is_read(2).error().message,
            "max_ratio is only read where min_count is not 0, and it is 0; leave max_ratio out, or change "
            "min_count");
  fields.pairs = "";
  EXPECT_EQ(
      is_read(1).error().message,
      "min_count is only read where pairs is frustum, and it is empty; leave min_count out, or change pairs");
}

}  // namespace
}  // namespace cairn
