#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/atlas/atlas_file.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/c_api/cairn.h"
#include "tests/install/poster_wings.h"

namespace cairn {
namespace {

using testing::HasSubstr;

// An atlas of the map of two wings and of the same wings on another floor.
class CAtlas : public testing::Test {
 protected:
  CAtlas() {
    AtlasRows atlas;
    atlas.name = "floors";
    for (const char* name : {"ground", "upper"}) {
      MapRows rows = Wings().rows();
      rows.name = name;
      const std::string path = testing::TempDir() + "/c_atlas_" + name + ".cairn";
      EXPECT_TRUE(WriteMapRows(rows, path).ok());
      atlas.code_book = LearnCodeBook(rows.descriptors);
      std::vector<uint32_t> codes;
      for (Eigen::Index i = 0; i < rows.descriptors.rows(); ++i)
        codes.push_back(CodeOf(atlas.code_book, rows.descriptors.row(i).data()).bits);
      std::sort(codes.begin(), codes.end());
      codes.erase(std::unique(codes.begin(), codes.end()), codes.end());
      atlas.maps.push_back({.name = name,
                            .file = std::filesystem::path(path).filename(),
                            .fingerprint = FingerprintOf(MapFile::Open(path, {})->seal().root),
                            .num_images = static_cast<int64_t>(rows.images.size()),
                            .places = {codes}});
    }
    EXPECT_TRUE(WriteFileAtomically(path_, *EncodeAtlas(std::nullopt, &atlas)).ok());
    EXPECT_EQ(cairn_atlas_open(path_.c_str(), nullptr, &atlas_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_atlas_localizer_create(atlas_, &localizer_), CAIRN_OK) << cairn_last_error();
  }
  ~CAtlas() override {
    EXPECT_EQ(cairn_atlas_localizer_destroy(localizer_), CAIRN_OK);
    EXPECT_EQ(cairn_atlas_close(atlas_), CAIRN_OK);
  }

  static cairn_image Picture(int number) {
    const cv::Mat& picture = Wings().pictures()[number];
    cairn_image image = CAIRN_IMAGE_INIT;
    image.pixels = picture.data;
    image.width = picture.cols;
    image.height = picture.rows;
    image.stride = picture.step;
    return image;
  }

  std::string path_ = testing::TempDir() + "/c.atlas";
  cairn_atlas* atlas_ = nullptr;
  cairn_atlas_localizer* localizer_ = nullptr;
};

TEST_F(CAtlas, AnswersAreThoseOfCxx) {
  AtlasLocalizer expected(*Atlas::Open(path_));
  int num_places_in_all = 0;
  for (int picture = 0; picture < 7; ++picture) {
    const cairn_image image = Picture(picture);
    std::array<int32_t, 4> maps{};
    std::array<double, 4> probabilities{};
    int32_t num_places = -1;
    double elsewhere = -1;
    cairn_fix fix = CAIRN_FIX_INIT;
    ASSERT_EQ(cairn_atlas_localize(localizer_, &image, nullptr, maps.data(), probabilities.data(), 4,
                                   &num_places, &elsewhere, &fix),
              CAIRN_OK)
        << cairn_last_error();
    const AtlasAnswer answer = *expected.Localize(Wings().pictures()[picture]);
    ASSERT_EQ(num_places, static_cast<int32_t>(answer.hypotheses.size()));
    for (int32_t i = 0; i < num_places; ++i) {
      EXPECT_EQ(maps[i], answer.hypotheses[i].map);
      EXPECT_EQ(probabilities[i], answer.hypotheses[i].probability);
    }
    num_places_in_all += num_places;
    EXPECT_EQ(elsewhere, answer.elsewhere);
    if (num_places > 0) {
      EXPECT_EQ(fix.probability, probabilities[0]);
      EXPECT_EQ(fix.reason, static_cast<int32_t>(answer.hypotheses[0].found.reason));
    } else {
      EXPECT_EQ(fix.has_fix, 0);
      EXPECT_STREQ(fix.message, answer.best_failure.message.c_str());
    }
    // Only as many as there is room for; and nothing but whether it is known.
    ASSERT_EQ(cairn_atlas_localize(localizer_, &image, nullptr, maps.data(), probabilities.data(), 1,
                                   &num_places, nullptr, nullptr),
              CAIRN_OK);
    EXPECT_EQ(num_places, std::min<int32_t>(1, static_cast<int32_t>(answer.hypotheses.size())));
    ASSERT_EQ(cairn_atlas_localize(localizer_, &image, nullptr, nullptr, nullptr, 0, &num_places, &elsewhere,
                                   nullptr),
              CAIRN_OK);
    EXPECT_EQ(elsewhere, answer.elsewhere);
  }
  EXPECT_GT(num_places_in_all, 7);  // both floors explain what they show
}

TEST_F(CAtlas, GivesTheMapInWhichTheRobotIs) {
  int32_t num_maps = 0;
  ASSERT_EQ(cairn_atlas_num_maps(atlas_, &num_maps), CAIRN_OK);
  EXPECT_EQ(num_maps, 2);
  cairn_map* map = nullptr;
  ASSERT_EQ(cairn_atlas_open_map(atlas_, 1, &map), CAIRN_OK) << cairn_last_error();
  cairn_map_description description = CAIRN_MAP_DESCRIPTION_INIT;
  ASSERT_EQ(cairn_map_describe(map, &description), CAIRN_OK);
  EXPECT_STREQ(description.name, "upper");
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
  for (const int32_t none : {-1, 2}) {
    EXPECT_EQ(cairn_atlas_open_map(atlas_, none, &map), CAIRN_INVALID_ARGUMENT);
    EXPECT_EQ(map, nullptr);
  }
}

TEST_F(CAtlas, OptionsAreSetByName) {
  EXPECT_EQ(cairn_atlas_localizer_set_option(localizer_, "max_num_maps", "1"), CAIRN_OK);
  EXPECT_EQ(cairn_atlas_localizer_set_option(localizer_, "min_num_features", "100000"), CAIRN_OK);
  const cairn_image image = Picture(0);
  cairn_fix fix = CAIRN_FIX_INIT;
  int32_t num_places = -1;
  ASSERT_EQ(
      cairn_atlas_localize(localizer_, &image, nullptr, nullptr, nullptr, 0, &num_places, nullptr, &fix),
      CAIRN_OK);
  EXPECT_EQ(fix.reason, CAIRN_TOO_FEW_FEATURES);
  EXPECT_EQ(cairn_atlas_localizer_set_option(localizer_, "max_num_maps", "0"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_localizer_set_option(localizer_, "maps", "1"), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CAtlas, MisuseIsSaid) {
  cairn_atlas* atlas = nullptr;
  EXPECT_EQ(cairn_atlas_open(nullptr, nullptr, &atlas), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_open(path_.c_str(), nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_open("none.atlas", nullptr, &atlas), CAIRN_NOT_FOUND);
  EXPECT_EQ(atlas, nullptr);
  cairn_map_options options = CAIRN_MAP_OPTIONS_INIT;
  options.min_epoch = 1;
  EXPECT_EQ(cairn_atlas_open(path_.c_str(), &options, &atlas), CAIRN_NOT_NEWER);
  options = CAIRN_MAP_OPTIONS_INIT;
  options.name = "floor";
  EXPECT_EQ(cairn_atlas_open(path_.c_str(), &options, &atlas), CAIRN_OTHER_MAP);
  EXPECT_EQ(cairn_atlas_num_maps(nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_num_maps(atlas_, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_open_map(atlas_, 0, nullptr), CAIRN_INVALID_ARGUMENT);
  cairn_atlas_localizer* none = nullptr;
  EXPECT_EQ(cairn_atlas_localizer_create(nullptr, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_localizer_create(atlas_, nullptr), CAIRN_INVALID_ARGUMENT);
  const cairn_image image = Picture(0);
  int32_t map = 0, num_places = 9;
  double probability = 0;
  const auto localize = [&](int32_t* maps, double* probabilities, int32_t capacity, int32_t* num) {
    return cairn_atlas_localize(localizer_, &image, nullptr, maps, probabilities, capacity, num, nullptr,
                                nullptr);
  };
  EXPECT_EQ(localize(nullptr, &probability, 1, &num_places), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(num_places, 0);
  EXPECT_THAT(cairn_last_error(), HasSubstr("maps is NULL"));
  EXPECT_EQ(localize(&map, nullptr, 1, &num_places), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(localize(&map, &probability, -1, &num_places), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(localize(&map, &probability, 1, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_atlas_localize(localizer_, nullptr, nullptr, &map, &probability, 1, &num_places, nullptr,
                                 nullptr),
            CAIRN_INVALID_ARGUMENT);
  // A handle of another kind, and one that was closed.
  EXPECT_EQ(cairn_map_close(reinterpret_cast<cairn_map*>(atlas_)), CAIRN_INVALID_ARGUMENT);
  ASSERT_EQ(cairn_atlas_open(path_.c_str(), nullptr, &atlas), CAIRN_OK);
  EXPECT_EQ(cairn_atlas_close(atlas), CAIRN_OK);
  EXPECT_EQ(cairn_atlas_close(atlas), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("closed"));
  EXPECT_EQ(cairn_atlas_close(nullptr), CAIRN_OK);
}

}  // namespace
}  // namespace cairn
