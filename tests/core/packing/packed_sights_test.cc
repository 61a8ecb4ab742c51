#include "core/packing/packed_sights.h"

#include <algorithm>
#include <array>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/base/random.h"
#include "core/packing/range_coder.h"
#include "tests/core/packing/page_decoder.h"

namespace cairn {
namespace {

using testing::ElementsAre;

// Reads packed sights as schemas/FORMAT.md says it, written from that page alone.
class PageSights {
 public:
  PageSights(std::string_view bytes, size_t num_images) : decoder_("") {
    BlobReader reader(bytes);
    num_landmarks_ = static_cast<int64_t>(reader.Varint());
    decoder_.Start(reader.Bytes(reader.num_left()));
    for (size_t image = 0; image < num_images; ++image) {
      std::array<int64_t, 2> back = {};
      for (int i = 0; i < 2; ++i) back[i] = decoder_.Symbol("reference" + std::to_string(i), 8);
      for (int i = 0; i < 2; ++i)
        reference_[i] = back[i] == 0 ? std::set<int64_t>() : seen[image - static_cast<size_t>(back[i])];
      references.push_back(back);
      seen.emplace_back();
      Group(0, 0, num_landmarks_);
    }
  }

  bool IsAtEnd() const { return decoder_.IsAtEnd(); }
  int64_t num_landmarks() const { return num_landmarks_; }

  std::vector<std::set<int64_t>> seen;             // by image
  std::vector<std::array<int64_t, 2>> references;  // how many images back; 0: none

 private:
  void Group(size_t level, int64_t begin, int64_t end) {
    constexpr int64_t kSizes[] = {4096, 256, 16};
    if (level == 3) {
      for (int64_t landmark = begin; landmark < end; ++landmark) Landmark(landmark);
      return;
    }
    int64_t one_before = 0, two_before = 0;
    for (int64_t first = begin; first < end; first += kSizes[level]) {
      const int64_t last = std::min(end, first + kSizes[level]);
      int64_t num = 0;
      for (const std::set<int64_t>& reference : reference_)
        num += std::distance(reference.lower_bound(first), reference.lower_bound(last));
      const bool any = decoder_.Bit("any of " + std::to_string(kSizes[level]),
                                    {std::min<int64_t>(num, 5), one_before, two_before});
      two_before = one_before;
      one_before = any ? 1 : 0;
      if (!any) continue;
      const size_t num_before = seen.back().size();
      Group(level + 1, first, last);
      EXPECT_GT(seen.back().size(), num_before) << "bits for a group of which nothing is seen";
    }
  }

  void Landmark(int64_t landmark) {
    int64_t times = 0;
    for (size_t i = 0; i + 1 < seen.size(); ++i) times += static_cast<int64_t>(seen[i].count(landmark));
    std::set<int64_t>& own = seen.back();
    const auto just_seen = static_cast<int64_t>(own.count(landmark - 1) + own.count(landmark - 2));
    const bool sees = decoder_.Bit("sees", {static_cast<int64_t>(reference_[0].count(landmark)),
                                            static_cast<int64_t>(reference_[1].count(landmark)),
                                            std::min<int64_t>(times, 3), just_seen});
    if (sees) own.insert(landmark);
  }

  PageDecoder decoder_;
  int64_t num_landmarks_ = 0;
  std::array<std::set<int64_t>, 2> reference_;
};

bool Unpack(std::string_view bytes, int64_t num_landmarks, size_t max_num_seen, SightLists* lists) {
  int64_t num_left = 1'000'000;
  return UnpackSights(bytes, num_landmarks, max_num_seen, &num_left, lists);
}

// What is packed is read, and is what the page says that the bytes are.
void ExpectDrawn(const SightLists& images) {
  const std::string bytes = PackSights(images);
  SightLists read(images.size());
  int64_t num_landmarks = 0;
  size_t most = 0;
  for (const std::vector<int32_t>& image : images) {
    most = std::max(most, image.size());
    if (!image.empty()) num_landmarks = std::max<int64_t>(num_landmarks, image.back() + 1);
  }
  ASSERT_TRUE(Unpack(bytes, num_landmarks, most, &read));
  EXPECT_EQ(read, images);
  const PageSights page(bytes, images.size());
  EXPECT_EQ(page.num_landmarks(), num_landmarks);
  for (size_t i = 0; i < images.size(); ++i)
    EXPECT_EQ(page.seen[i], std::set<int64_t>(images[i].begin(), images[i].end())) << i;
  EXPECT_TRUE(page.IsAtEnd());
}

// Each image sees stretches of what there is, with gaps; the next much the same.
SightLists Stretches(size_t num_images, int64_t num_landmarks, uint64_t seed) {
  Random random(seed);
  SightLists images(num_images);
  std::vector<std::pair<int64_t, int64_t>> stretches;
  for (std::vector<int32_t>& image : images) {
    if (stretches.empty() || random.Uniform() < 0.2) {
      stretches.clear();
      for (int i = 0; i < 3; ++i)
        stretches.emplace_back(random.UniformInt(0, num_landmarks - 1),
                               random.UniformInt(1, i == 0 ? 600 : 30));
    }
    std::set<int32_t> seen;
    for (const auto& [first, length] : stretches) {
      for (int64_t k = first; k < std::min(num_landmarks, first + length); ++k) {
        if (random.Uniform() < 0.7) seen.insert(static_cast<int32_t>(k));
      }
    }
    image.assign(seen.begin(), seen.end());
  }
  return images;
}

TEST(PackedSights, BytesAreThoseThatThePageDraws) {
  ExpectDrawn({});
  ExpectDrawn({{}});
  ExpectDrawn({{}, {0}, {}, {0}});
  ExpectDrawn({{15}, {16}, {255, 256}, {4095, 4096}, {15, 16, 4096}});
  ExpectDrawn(Stretches(64, 700, 1));
  ExpectDrawn(Stretches(64, 20'000, 2));
  ExpectDrawn(Stretches(30, 4097, 3));
}

// By landmarks in common, twice, less how many the other sees; of equals the nearer.
//
//            0 1 2 3 4 5 6 7     for the last
//   image 0  x x                 2 - 2 * 2 = -2
//   image 1      x x x x x x     6 - 2 * 2 = 2
//   image 2  x x x x             4 - 2 * 4 = -4
//   image 3  x x                 -2, nearer
//   image 4              x x     2
//   image 5  x x x x
TEST(PackedSights, ReferencesAreThoseThatSeeMostAlike) {
  const SightLists images = {{0, 1}, {2, 3, 4, 5, 6, 7}, {0, 1, 2, 3}, {0, 1}, {6, 7}, {0, 1, 2, 3}};
  const PageSights page(PackSights(images), images.size());
  EXPECT_THAT(page.references[0], ElementsAre(0, 0));
  EXPECT_THAT(page.references[1], ElementsAre(1, 0));
  EXPECT_THAT(page.references[2], ElementsAre(2, 1));  // 2 - 4 and 6 - 4
  EXPECT_THAT(page.references[3], ElementsAre(3, 1));  // 2 - 4 and 4 - 4
  EXPECT_THAT(page.references[5], ElementsAre(3, 2));
}

// 8 bits say how many images back, so 255 at most.
TEST(PackedSights, ReferencesAreAtMost255ImagesBack) {
  SightLists images(258);
  for (size_t i = 0; i < images.size(); ++i) images[i] = {static_cast<int32_t>(3 + i)};
  images[0] = images[1] = images[2] = {0, 1, 2};
  images[255] = images[256] = images[257] = {0, 1, 2};
  const PageSights page(PackSights(images), images.size());
  EXPECT_THAT(page.references[255], ElementsAre(253, 254));
  EXPECT_THAT(page.references[256], ElementsAre(1, 254));
  EXPECT_THAT(page.references[257], ElementsAre(1, 2));
  images[255] = {900};
  const PageSights fewer(PackSights(images), images.size());
  EXPECT_THAT(fewer.references[256], ElementsAre(254, 255));
  EXPECT_THAT(fewer.references[257], ElementsAre(1, 255));
}

TEST(PackedSights, ListsBeyondTheLimitsAreRefused) {
  const SightLists images = {{0, 1, 4}, {2}};
  const std::string bytes = PackSights(images);
  SightLists read(2);
  EXPECT_TRUE(Unpack(bytes, 5, 3, &read));
  EXPECT_TRUE(Unpack(bytes, 6, 4, &read));
  EXPECT_FALSE(Unpack(bytes, 4, 3, &read));
  EXPECT_FALSE(Unpack(bytes, 5, 2, &read));
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(Unpack(bytes.substr(0, size), 5, 3, &read)) << size;
  EXPECT_FALSE(Unpack(bytes + '\0', 5, 3, &read));
  // A varint of 64 bits, which are negative as a number.
  EXPECT_FALSE(Unpack(std::string(9, '\xff') + '\1' + bytes.substr(1), 5, 3, &read));
}

TEST(PackedSights, AllTogetherAreNoMoreThanAreLeft) {
  const SightLists images = {{0, 1, 4}, {2}, {}, {0, 4}};
  const std::string bytes = PackSights(images);
  for (const int64_t most : {6, 7, 1000, 5, 4, 3, 2, 0, -1}) {
    SightLists read(images.size());
    int64_t num_left = most;
    EXPECT_EQ(UnpackSights(bytes, 5, 3, &num_left, &read), most >= 6) << most;
    if (most >= 6) EXPECT_EQ(num_left, most - 6);
  }
}

// A reference to an image before the first, in each of the two places.
TEST(PackedSights, ReferencesBeforeTheFirstImageAreRefused) {
  for (const uint32_t back : {1u, 2u}) {
    for (const bool is_second : {false, true}) {
      RangeEncoder encoder;
      std::array<AdaptiveSymbol<8>, 2> references;
      for (int image = 0; image < 2; ++image) {
        references[0].Code(encoder, image == 1 && !is_second ? back : 0);
        references[1].Code(encoder, image == 1 && is_second ? back : 0);
      }
      SightLists read(2);
      EXPECT_EQ(Unpack('\0' + encoder.Take(), 0, 1, &read), back == 1);
    }
  }
}

}  // namespace
}  // namespace cairn
