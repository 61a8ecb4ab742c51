#include "stages/reconstruct/verdict/draw_verdict.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stages/reconstruct/verdict/verdict_json.h"
#include "tests/reconstruct/verdict/model_of_sights.h"

namespace cairn::reconstruct {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

int CountOf(const std::string& text, const std::string& part) {
  int count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// A round of so many images that sees its start again.
ColmapModel Round(const std::vector<std::string>& names) {
  const int num = static_cast<int>(names.size());
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < num; ++i)
    places.emplace_back(10 * std::cos(6.0 * i / num), 10 * std::sin(6.0 * i / num), 1);
  std::vector<ModelSight> sights = SightsOfNext(num, 200);
  sights.push_back({{0, num - 1}, 60});
  return ModelOfSights(names, places, sights);
}

TEST(DrawVerdict, NamesEveryImageAndWhatJoinsItToTheNext) {
  const std::string svg = DrawVerdict(JudgeModels({Round(NumberedNames(20))}), "round");
  EXPECT_THAT(svg, AllOf(HasSubstr(">round</text>"), HasSubstr("20 of 20 images joined; 56.8 m; 1 loop<"),
                         HasSubstr("<title>0.jpg to 1.jpg: 200 points, 3.0 m</title>"),
                         HasSubstr("<title>18.jpg to 19.jpg: 200 points, 3.0 m</title>"),
                         HasSubstr("<title>loop of 56.8 m: 0.jpg to 19.jpg, 60 points in common</title>")));
  EXPECT_THAT(svg, AllOf(HasSubstr(">start</text>"), HasSubstr(">end</text>"), HasSubstr(">5 m</text>"),
                         Not(HasSubstr("<title>missing")), Not(HasSubstr("nan"))));
}

TEST(DrawVerdict, DrawsMissingImagesBetweenTheirNeighbours) {
  ColmapModel model = Round(NumberedNames(20));
  model.images.erase(model.images.begin() + 7, model.images.begin() + 10);
  const std::string svg = DrawVerdict(
      JudgeModels({model}, {{"7.jpg", ""}, {"8.jpg", ""}, {"9.jpg", ""}, {"20.jpg", ""}, {"x/1.jpg", ""}}),
      "");
  // 12 m of 20 m on 900 pixels: room for three marks; the last image is one at the end; the other's folder
  // has no place.
  EXPECT_EQ(CountOf(svg, "<title>missing: "), 4);
  EXPECT_THAT(svg,
              AllOf(HasSubstr("<title>missing: 8.jpg</title>"), HasSubstr("<title>missing: 20.jpg</title>"),
                    HasSubstr("6.jpg to 10.jpg: 0 points, "), HasSubstr(" m, 3 missing</title>"),
                    HasSubstr("<title>weak: 6.jpg to 10.jpg, joined by 0 points</title>"),
                    Not(HasSubstr("x/1.jpg"))));
}

// Where there is no room, a mark stands for several.
TEST(DrawVerdict, ManyMissingImagesInASmallGapAreFewMarks) {
  std::vector<Reject> rejects;
  for (int i = 0; i < 300; ++i) rejects.push_back({fmt::format("7.{:03}.jpg", i), ""});
  const std::string svg = DrawVerdict(JudgeModels({Round(NumberedNames(100))}, rejects), "");
  EXPECT_GE(CountOf(svg, "<title>missing: "), 1);
  EXPECT_LE(CountOf(svg, "<title>missing: "), 6);
  EXPECT_THAT(svg, HasSubstr("<title>missing: 7.000.jpg to "));
  EXPECT_THAT(svg, HasSubstr("7.299.jpg, "));
}

TEST(DrawVerdict, NoNameIsMarkup) {
  const std::string hostile = "<script>&\"'\x1b.jpg", shown = "&lt;script&gt;&amp;&quot;&#39;\ufffd.jpg";
  std::vector<std::string> names = NumberedNames(12);
  for (std::string& name : names) name = hostile + name;
  ColmapModel apart = Round(NumberedNames(3));
  for (ModelImage& image : apart.images) image.name = "z" + hostile + image.name;
  std::vector<Reject> rejects = {{hostile + "5.5.jpg", hostile}};
  for (const ModelImage& image : apart.images) rejects.push_back({image.name, hostile});
  const std::string svg = DrawVerdict(JudgeModels({Round(names), apart}, rejects), hostile);
  EXPECT_THAT(svg, AllOf(Not(HasSubstr("<script")), HasSubstr("<title>" + shown + "0.jpg to "),
                         HasSubstr("missing: " + shown + "5.5.jpg"), HasSubstr(">" + shown + "</text>"),
                         HasSubstr("3 images: z" + shown + "0.jpg to z" + shown + "2.jpg")));
  EXPECT_EQ(svg.find('\x1b'), std::string::npos);
}

TEST(DrawVerdict, ALongDriveStaysSmall) {
  std::vector<std::string> names = NumberedNames(2000);
  const std::string svg = DrawVerdict(JudgeModels({Round(names)}), "long");
  EXPECT_LE(svg.size(), 300000);
  EXPECT_THAT(svg, HasSubstr("<title>0.jpg to 2.jpg, 3 images: 200 points or more, "));
  // Names as long as a folder allows, and every character an entity.
  for (size_t i = 0; i < names.size(); ++i) names[i] = std::string(200, '&') + names[i];
  const std::string longest = DrawVerdict(JudgeModels({Round(names)}), names[0]);
  EXPECT_LE(longest.size(), 300000);
  EXPECT_THAT(longest, HasSubstr("\u2026&amp;"));
}

TEST(DrawVerdict, ManyImagesInNoOrderStaySmall) {
  const int num = 2000;
  std::vector<Eigen::Vector3d> places;
  std::vector<ModelSight> sights;
  for (int i = 0; i < num; ++i) {
    places.emplace_back(i * 7 % 45, i * 13 % 44, 0);
    if (i > 0) sights.push_back({{i, i * 7 % i}, 60});
  }
  const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(num), places, sights)});
  EXPECT_FALSE(verdict.is_drive);
  const std::string svg = DrawVerdict(verdict, "heap");
  EXPECT_LE(svg.size(), 300000);
  EXPECT_THAT(svg, AllOf(HasSubstr("points that join two images:"), HasSubstr(" more images</title>"),
                         Not(HasSubstr(">start<")), Not(HasSubstr("missing images"))));
}

TEST(DrawVerdict, ImagesAtOnePlaceAndOneImageHaveAPicture) {
  const std::vector<Eigen::Vector3d> here(3, Eigen::Vector3d(1, 2, 3));
  for (const ColmapModel& model : {ModelOfSights(NumberedNames(3), here, SightsOfNext(3, 100)),
                                   ModelOfSights({"only.jpg"}, {{1, 2, 3}}, {}),
                                   ModelOfSights(NumberedNames(3), PlacesInARow(3), SightsOfNext(3, 100))}) {
    const std::string svg = DrawVerdict(JudgeModels({model}), "small");
    EXPECT_THAT(svg, AllOf(HasSubstr("</svg>"), Not(HasSubstr("nan")), Not(HasSubstr("inf"))));
  }
}

TEST(DrawVerdict, AnUnknownScaleIsSaid) {
  Verdict verdict = JudgeModels({Round(NumberedNames(20))});
  verdict.is_metric = false;
  EXPECT_THAT(DrawVerdict(verdict, ""), AllOf(HasSubstr(">5 units: the scale is not known</text>"),
                                              HasSubstr("56.8 units; 1 loop"), Not(HasSubstr(" m<"))));
}

TEST(VerdictJson, IsReadBackToTheSamePicture) {
  ColmapModel model = Round(NumberedNames(40)), apart = Round(NumberedNames(3));
  model.images.erase(model.images.begin() + 7, model.images.begin() + 10);
  for (ModelImage& image : apart.images) image.name = "z" + image.name;
  const Verdict verdict =
      JudgeModels({model, apart}, {{"7.jpg", "dark"}, {"8.jpg", "dark"}, {"z0.jpg", ""}, {"a/9.jpg", ""}});
  const nlohmann::ordered_json json = VerdictJson(verdict);
  const auto read = ParseVerdict(nlohmann::ordered_json::parse(json.dump()));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(DrawVerdict(*read, "again"), DrawVerdict(verdict, "again"));
  EXPECT_EQ(VerdictJson(*read), json);
  EXPECT_EQ(json["loops"][0]["from"], "0.jpg");
  EXPECT_EQ(json["weak_links"][0]["to"], "10.jpg");
  EXPECT_EQ(json["num_parts"], 2);
}

// Each value in turn is taken away, or is something else: the file is refused, and nothing else happens.
TEST(VerdictJson, WhatIsNotAVerdictIsRefused) {
  ColmapModel model = Round(NumberedNames(40)), apart = Round(NumberedNames(3));
  model.images.erase(model.images.begin() + 7);
  for (ModelImage& image : apart.images) image.name = "z" + image.name;
  const nlohmann::ordered_json json =
      VerdictJson(JudgeModels({model, apart}, {{"7.jpg", "dark"}, {"z0.jpg", ""}}));
  EXPECT_FALSE(ParseVerdict(nlohmann::ordered_json(5)).ok());
  EXPECT_FALSE(ParseVerdict(nlohmann::ordered_json::object()).ok());
  // Not read, but for people.
  const std::vector<std::string> told = {"/text",      "/is_whole", "/num_images", "/num_joined",
                                         "/num_parts", "/from",     "/to"};
  const nlohmann::ordered_json flat = json.flatten();
  int num_refused = 0;
  for (const auto& [path, value] : flat.items()) {
    const bool is_told = std::any_of(told.begin(), told.end(),
                                     [&path = path](const std::string& end) { return path.ends_with(end); });
    if (is_told || path.starts_with("/weak_links/0/num") || path.ends_with("/weak_links/0/length")) continue;
    nlohmann::ordered_json wrong = json;
    wrong[nlohmann::ordered_json::json_pointer(path)] = nlohmann::ordered_json::array({1});
    if (value.is_array() || value.is_object()) continue;  // an empty list
    const auto read = ParseVerdict(wrong);
    EXPECT_FALSE(read.ok()) << path;
    if (!read.ok()) {
      EXPECT_THAT(read.error().message, HasSubstr("' is not "));
    }
    ++num_refused;
  }
  EXPECT_GT(num_refused, 100);
  for (const auto& [path, value] : std::vector<std::pair<const char*, nlohmann::ordered_json>>{
           {"/links/image2/0", 39},
           {"/links/image1/0", -1},
           {"/loops/0/image2", 39},
           {"/missing/0/before", 39},
           {"/missing/0/after", -1},
           {"/weak_links/0/link", 1000},
           {"/images/x/0", 1e30},
           {"/images/x", nlohmann::ordered_json::array({1, 2})},
           {"/images/name", nlohmann::ordered_json::array()},
           {"/way", nullptr}}) {
    nlohmann::ordered_json wrong = json;
    wrong[nlohmann::ordered_json::json_pointer(path)] = value;
    EXPECT_FALSE(ParseVerdict(wrong).ok()) << path;
  }
}

}  // namespace
}  // namespace cairn::reconstruct
